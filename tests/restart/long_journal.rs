//! A journal of a month: restarting, checking and writing results take time and memory that do not
//! grow with its length. It is short by default. A month, each test in a process of its own, since
//! the peak of memory is the process's: `GYRE_POSES=26000000 cargo test --release -p gyre --test
//! long_journal NAME -- --nocapture`; 550 bytes to 1 kB of disk a pose, minutes under `eatmydata`.

#![allow(clippy::unwrap_used)]

use std::{
    fs,
    os::unix::fs::FileExt,
    path::Path,
    time::{Duration, Instant},
};

use gyre_configuration::Configuration;
use gyre_contract::{Hop, Item, MotionEstimate, PoseHeader, flag, run::Ending};
use gyre_journal::{self as journal, Journal};
use gyre_results::{Out, Session};
use tempfile::TempDir;

/// Poses that a restart asks for with a usual window.
const LAST: usize = 16;
/// The limit of resident memory, however long the journal is, MB.
const MAX_PEAK_MB: f64 = 64.0;

fn poses() -> u64 {
    std::env::var("GYRE_POSES").map_or(20_000, |poses| poses.parse().unwrap())
}

/// The largest resident memory of this process so far, MB.
fn peak_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = peak.and_then(|it| it.trim().strip_suffix(" kB")).unwrap();
    kilobytes.parse::<f64>().unwrap() / 1024.0
}

fn folder() -> TempDir {
    let place = std::env::var_os("GYRE_LONG").unwrap_or_else(|| std::env::temp_dir().into());
    tempfile::Builder::new()
        .prefix("gyre-long-")
        .tempdir_in(place)
        .unwrap()
}

fn pose(seq: u64) -> PoseHeader {
    let done_ns = 1_000_000_000 + 100_000_000 * seq as i64;
    let hop = |k: i64| Hop {
        received_ns: done_ns + k * 5_000_000,
        started_ns: done_ns + k * 5_000_000 + 1_000,
        finished_ns: done_ns + k * 5_000_000 + 4_000_000 + (seq % 97) as i64 * 1_000,
        published_ns: done_ns + k * 5_000_000 + 4_500_000,
    };
    let angle = seq as f64 * 1e-3;
    PoseHeader {
        item: Item {
            seq,
            scan: seq,
            published: seq,
            previous_scan: seq.saturating_sub(1),
            stamp_ns: 1_700_000_000_000_000_000 + 100_000_000 * seq as i64,
            due_ns: done_ns,
            hops: std::array::from_fn(|k| hop(k as i64)),
            flags: if seq == 0 { flag::BREAK } else { 0 },
            ..Item::default()
        },
        motion: MotionEstimate {
            x_m: 1.0,
            interval_ns: 100_000_000,
            ..MotionEstimate::default()
        },
        x_m: 900.0 * angle.cos(),
        y_m: 900.0 * angle.sin(),
        ..PoseHeader::default()
    }
}

fn forge(out: &Path, poses: u64) {
    let mut journal = Journal::open(out).unwrap();
    (0..poses).for_each(|seq| journal.append(&pose(seq)).unwrap());
    let mut end = pose(poses);
    end.item.flags = flag::END;
    journal.append(&end).unwrap();
}

#[test]
fn a_restart_reads_the_end_alone() {
    let (folder, poses) = (folder(), poses());
    forge(folder.path(), poses);
    let path = journal::path(folder.path());
    let length = fs::metadata(&path).unwrap().len();
    // Damage that is found only by what reads it.
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.write_all_at(&[0x55; 4096], length / 2).unwrap();
    let (before, since) = (peak_mb(), Instant::now());
    let mut journal = Journal::open(folder.path()).unwrap();
    let (last, ended) = journal.last(LAST).unwrap();
    let (took, peak) = (since.elapsed(), peak_mb());
    assert_eq!(
        (last.len(), last[LAST - 1].item.seq, ended),
        (LAST, poses - 1, true)
    );
    println!(
        "{poses} poses, {:.1} GB: opened in {took:?}, peak {peak:.1} MB ({before:.1} before)",
        length as f64 * 1e-9
    );
    assert!(peak < MAX_PEAK_MB);
}

#[test]
fn a_check_and_results_take_bounded_memory() {
    let (folder, poses) = (folder(), poses());
    forge(folder.path(), poses);
    let since = Instant::now();
    let content = journal::check(folder.path()).unwrap();
    assert_eq!(
        (content.poses, content.ended, content.torn),
        (poses, true, 0)
    );
    println!("{poses} poses: checked in {:?}", since.elapsed());
    let configuration = Configuration::of_overrides(&[]).unwrap();
    let out = Out::lock(folder.path()).unwrap();
    let session = Session {
        scans: Some(poses as usize),
        resumed: 0,
        damage: None,
        needs_all: false,
        wall: Duration::from_secs(1),
        footprint: None,
        ending: Some(Ending::Complete),
        report: None,
    };
    let since = Instant::now();
    let written = gyre_results::write(&configuration, &out, &session, &|_| Ok(true)).unwrap();
    assert_eq!((written.poses as u64, written.ended), (poses, true));
    let (took, peak) = (since.elapsed(), peak_mb());
    println!("{poses} poses: results in {took:?}, peak {peak:.1} MB");
    assert!(peak < MAX_PEAK_MB);
}
