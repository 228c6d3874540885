//! Times of the refinement of a scan on this machine, one thread, medians: of scans that become a
//! keyframe, and of others in between.
#![allow(clippy::unwrap_used)]

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;
use std::time::Instant;

use common::scenes::{CAPACITY, Drive, SWEEP_S, Sensor, scans, searched, town};
use gyre_scan_matching::{RefinementConfig, Refiner};

const SCANS: usize = 400;

fn main() {
    let drive = Drive::steady(4.0, 2.0, SCANS);
    let scene = town([[-700.0, 700.0], [-100.0, 1300.0]], 1);
    let scans = scans(&scene, &drive, &Sensor::default());
    let points = scans.iter().map(Vec::len).sum::<usize>() / SCANS;
    println!("refinement: {SCANS} scans of {points} points, 1 m apart, ms");
    println!(
        "{:>9} {:>9} {:>20} {:>13}",
        "keyframes", "aligned", "and made a keyframe", "the keyframe"
    );
    for keyframes in [1, 5, 10, 20] {
        let config = RefinementConfig {
            keyframes,
            ..RefinementConfig::default()
        };
        let mut refiner = Refiner::new(&config, CAPACITY).unwrap();
        let mut times = [Vec::new(), Vec::new()];
        for k in 0..SCANS - 1 {
            let number = k as u64 + 1;
            let start = Instant::now();
            black_box(refiner.refine(
                number,
                &scans[k + 1],
                &scans[k],
                &searched(&drive, k),
                SWEEP_S,
            ));
            let time = start.elapsed().as_secs_f64() * 1e3;
            let became_keyframe = refiner
                .keyframes()
                .last()
                .is_some_and(|last| last.id == number);
            times[usize::from(became_keyframe)].push(time);
        }
        let [aligned, both] = times.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        });
        println!(
            "{keyframes:9} {aligned:9.3} {both:20.3} {:13.3}",
            both - aligned
        );
    }
}
