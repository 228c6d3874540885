//! `gyre record`: records a running run, from outside or as a process of it.

use std::{process::ExitCode, time::Duration};

use gyre_recorder::{Options, Split};
use gyre_terminal::{Failure, print, seconds};

use crate::cli::{RecordArguments, SplitArguments};

pub fn record(arguments: &RecordArguments) -> Result<ExitCode, Failure> {
    let span = seconds("--split-s", arguments.split.split_s)?;
    let options = Options {
        out: arguments.run.folder()?,
        to: arguments.to.clone(),
        topics: arguments.topics.clone(),
        split: split(&arguments.split, span),
        continues: arguments.continues,
    };
    Ok(match gyre_recorder::record(&options) {
        Ok(recorded) => {
            print::note(&recorded);
            // To the run it is no failure, and no reason for a restart.
            match recorded.is_complete() || arguments.continues {
                true => ExitCode::SUCCESS,
                false => ExitCode::FAILURE,
            }
        }
        Err(error) => {
            print::note(format_args!("gyre record: {error}"));
            ExitCode::from(error.exit_code())
        }
    })
}

fn split(arguments: &SplitArguments, span: Duration) -> Split {
    let span_ns = i64::try_from(span.as_nanos()).unwrap_or(i64::MAX);
    Split {
        bytes: (arguments.split_mb > 0).then_some(arguments.split_mb.saturating_mul(1_000_000)),
        span_ns: (span_ns > 0).then_some(span_ns),
    }
}
