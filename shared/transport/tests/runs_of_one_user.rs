//! Runs of one user that begin and end at the same time. In a process of its own, since each
//! removes the dead runs that other tests leave.

#![allow(clippy::unwrap_used)]

use std::thread;

use gyre_transport::{run::RunRoot, wake::Signals};

#[test]
fn runs_that_begin_while_the_last_one_of_the_user_ends_find_their_place() {
    thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let (out, signals) = (tempfile::tempdir().unwrap(), Signals::install().unwrap());
                for _ in 0..400 {
                    RunRoot::acquire(out.path(), &signals).unwrap();
                }
            });
        }
    });
}
