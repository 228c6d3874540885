//! A recording's scans, decoded on a thread of its own while those before them are worked on.

use std::{
    ops::Range,
    sync::mpsc::{channel, sync_channel},
    thread,
};

use gyre_radar::{Dataset, OwnedScan, ReadError};

use gyre::Failure;

/// Scans decoded or being decoded that nobody has looked at yet.
const AHEAD: usize = 4;

/// Shows `each` these scans, one after the other, by their numbers; also those that cannot be read.
///
/// # Errors
/// The first of `each`, after which no more are shown.
pub fn for_each_scan(
    dataset: &mut dyn Dataset,
    scans: Range<usize>,
    mut each: impl FnMut(usize, Result<&OwnedScan, ReadError>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let (decoded, to_show) = sync_channel(AHEAD);
    let (shown, to_fill) = channel();
    for _ in 0..AHEAD {
        let _ = shown.send(OwnedScan::with_limits(dataset.limits()));
    }
    thread::scope(move |scope| {
        scope.spawn(move || {
            // Either end hangs up when there is nothing more to do.
            for (index, mut scan) in scans.zip(to_fill) {
                let read = dataset
                    .read(index, scan.slot())
                    .map(|geometry| scan.geometry = geometry);
                if decoded.send((index, scan, read)).is_err() {
                    break;
                }
            }
        });
        for (index, scan, read) in to_show {
            each(index, read.map(|()| &scan))?;
            let _ = shown.send(scan);
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_radar::open_source;
    use gyre_simulator::{SimulatedDrive, SimulationConfig};

    use super::*;

    fn drive() -> Box<dyn Dataset> {
        let recording = SimulatedDrive::new(&SimulationConfig {
            scans: 7,
            ..SimulationConfig::default()
        })
        .unwrap();
        let options = recording.dataset_options();
        open_source(Box::new(recording.renderer()), &options).unwrap()
    }

    #[test]
    fn all_are_shown_in_order_as_they_are_read_alone() {
        let (mut ahead, mut alone) = (drive(), drive());
        let mut scan = OwnedScan::with_limits(alone.limits());
        let mut shown = Vec::new();
        for_each_scan(ahead.as_mut(), 1..7, |index, read| {
            scan.geometry = alone.read(index, scan.slot()).unwrap();
            assert!(read.unwrap().bytes == scan.bytes, "scan {index}");
            shown.push(index);
            Ok(())
        })
        .unwrap();
        assert_eq!(shown, [1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn it_ends_with_the_first_failure() {
        let mut shown = 0;
        let failed = for_each_scan(drive().as_mut(), 0..7, |index, _| {
            shown += 1;
            if index < 2 {
                Ok(())
            } else {
                Err("enough".into())
            }
        });
        assert_eq!(
            (failed.unwrap_err().to_string().as_str(), shown),
            ("enough", 3)
        );
    }
}
