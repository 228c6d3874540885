//! Live mode: a radar does not wait, so a slow stage sheds load, in one place, counted to the scan.

use crate::{
    common::{
        Run,
        odometry::{self, ChainRow},
        recording, send,
    },
    method::learned_masks::{TWO_SCANS, card},
};
use rustix::process::Signal;

/// The recording's period is 250 ms; played at this rate it is 60 ms and a bit.
const RATE: &str = "4";
/// One and a half of that.
const SLOW_MASKING_MS: u64 = 94;

fn live() -> Run {
    let run = Run::of_recording().rate(RATE).set("run.mode=live");
    run.set(&format!("stages.masking.delay_ms={SLOW_MASKING_MS}"))
}

/// Asserts that each scan is where it belongs: played, and then either in the chain or dropped.
fn assert_exact(run: &Run, rows: &[ChainRow]) {
    run.assert_counts("published=24 unreadable=0");
    // A motion has a row, and each chain starts with a scan that has none.
    let chains = run.count("breaks") + 1;
    let [processed, dropped] = ["processed", "dropped"].map(|key| run.count(key));
    assert_eq!(processed, rows.len() as u64 + chains);
    assert!(
        processed + dropped == 24 && dropped > 0,
        "{processed} {dropped}"
    );
    assert_eq!(rows.last().unwrap().scan, recording::SCANS as u64 - 1);
}

/// Scans that the chain stepped over.
fn stepped_over(rows: &[ChainRow]) -> u64 {
    rows.iter()
        .map(|row| row.scan - row.previous_scan - 1)
        .sum::<u64>()
        + rows[0].previous_scan
}

#[test]
fn slow_masking_drops_scans_and_the_chain_does_not_break() {
    let run = live();
    let rows = odometry::rows(&run.complete());
    assert_exact(&run, &rows);
    odometry::assert_unbroken(&rows);
    run.assert_counts("breaks=0 stages/radar-replay/processed=24");
    assert_eq!(run.count("dropped"), stepped_over(&rows));
    assert_eq!(
        run.count("stages/masking/processed"),
        run.count("processed")
    );
}

/// Behind masking nothing is dropped, so that the chain does not break there. A source that stops
/// hangs.
#[test]
fn any_process_can_die_and_every_scan_is_accounted_for() {
    let pair = || live().masked_by(&card(TWO_SCANS));
    for (run, killed) in [
        (live(), &["rotation-search"][..]),
        (live(), &["translation-search", "refinement"]),
        (live(), &["pose-integration"]),
        (live(), &["masking"]),
        (live(), &["radar-replay"]),
        (pair(), &["masking", "radar-replay"]),
        (live().set("run.stall_timeout_s=1"), &[]),
    ] {
        let mut running = run.start();
        let source = running.await_poses(5).await_stage("radar-replay");
        for stage in killed {
            running.kill(stage);
        }
        if killed.is_empty() {
            send(source, Signal::STOP);
        }
        running.finish().succeeded();
        let (summary, rows) = (run.summary(), odometry::rows(&run.odometry()));
        let restarted = if killed.is_empty() {
            &["radar-replay"]
        } else {
            killed
        };
        for stage in restarted {
            assert_eq!(summary["restarts"][*stage], 1, "{killed:?}");
        }
        assert_exact(&run, &rows);
        assert!(run.count("breaks") <= 1, "{summary}");
        if !restarted
            .iter()
            .any(|it| ["masking", "radar-replay"].contains(it))
        {
            odometry::assert_unbroken(&rows);
            assert_eq!(summary["dropped"], stepped_over(&rows), "{killed:?}");
        }
    }
}
