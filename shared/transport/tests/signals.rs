//! Signals to a process of its own, which this test starts from its own file.

#![allow(clippy::unwrap_used)]

use std::{
    env,
    os::unix::process::ExitStatusExt,
    process::{Command, id},
    thread,
    time::Duration,
};

use gyre_transport::wake::{Signals, let_signals_end_the_process};
use rustix::process::{Pid, Signal, kill_process};

const STARTED: &str = "GYRE_TEST_OF_SIGNALS";

/// Asks itself to stop, which wakes it, and once more where nobody waits for that.
fn ask_twice() {
    let ask = || kill_process(Pid::from_raw(id() as i32).unwrap(), Signal::TERM).unwrap();
    let signals = Signals::install().unwrap();
    ask();
    assert!(signals.sleep(Duration::from_secs(10)).unwrap());
    println!("has stopped");
    let_signals_end_the_process().unwrap();
    ask();
    // Another thread may have received it.
    thread::sleep(Duration::from_secs(10));
    println!("continues");
}

#[test]
fn a_signal_wakes_a_process_and_ends_it_where_nobody_waits() {
    if env::var_os(STARTED).is_some() {
        return ask_twice();
    }
    let mut itself = Command::new(env::current_exe().unwrap());
    let ended = itself.arg("--nocapture").env(STARTED, "").output().unwrap();
    let said = String::from_utf8_lossy(&ended.stdout);
    assert!(
        said.contains("has stopped") && !said.contains("continues"),
        "{said}"
    );
    assert_eq!(ended.status.signal(), Some(Signal::TERM.as_raw()));
}
