//! Observes a run: follows its poses and looks at the scans that they are of.
//!
//! ```sh
//! cargo build --release --example observe
//! gyre up configs/demo.toml --fresh --rate realtime
//! cargo run --release --example observe -- out/demo
//! ```
//!
//! `gyre up` returns when there is something to observe; a run that was just started by
//! `gyre run &` may not be there yet.
//!
//! Any number of programs up to `run.observers` may do so at once. Kill this one, or stop it for a
//! while with Ctrl-Z: the run does not notice.

use std::{error::Error, path::PathBuf, time::Duration};

use gyre_client::{Next, Run};
use gyre_contract::{Pose, Scan};

fn main() -> Result<(), Box<dyn Error>> {
    let out: PathBuf = std::env::args_os()
        .nth(1)
        .ok_or("usage: observe OUT, the folder of a run's results")?
        .into();
    let run = Run::open(&out)?;
    // One observer a topic. Each has a queue of its own, which loses its oldest message when it is
    // full.
    let mut scans = run.observe::<Scan>()?;
    let mut poses = run.observe::<Pose>()?;
    loop {
        match poses.next(Duration::from_secs(1))? {
            Next::Message(pose, missed) => {
                let pose = pose.header();
                let scan = pose.item.scan;
                println!("scan {scan}: x {:.2} m, y {:.2} m", pose.x_m, pose.y_m);
                if missed > 0 {
                    println!("  {missed} poses missed before it");
                }
            }
            Next::Idle => println!("no pose for a second"),
            Next::Ended => break,
        }
        // All scans that are there, without waiting. A message is read in the publisher's memory:
        // nothing is copied. It is released at the next call of `next`.
        while let Next::Message(scan, _) = scans.next(Duration::ZERO)? {
            let bytes: &[u8] = scan.values();
            let strongest = bytes.iter().max().copied().unwrap_or_default();
            println!("  scan {}: strongest return {strongest}", scan.item().scan);
        }
    }
    println!("missed: {} poses, {} scans", poses.missed(), scans.missed());
    Ok(())
}
