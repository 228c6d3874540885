//! Images of a simulated drive, rendered before they are needed, each by a thread. Since an image
//! depends on its number alone, threads and their timing change nothing.

use std::collections::VecDeque;
use std::thread::{self, JoinHandle};

use gyre_datasets::ImageSource as _;

use crate::simulated_drive::SimulatedDrive;

/// Images that are rendered ahead of the reader, which bounds the memory.
const AHEAD: usize = 6;
/// The renderers yield to the stages: on a vehicle the radar does their work.
const NICENESS: i32 = 10;

/// The images ahead of a reader. They may be read in any order; consecutive ones are fast.
#[derive(Default)]
pub(crate) struct Ahead {
    coming: VecDeque<(usize, JoinHandle<Vec<u8>>)>,
    /// A reader may need the first image only to inspect the recording.
    looked: bool,
}

impl Ahead {
    /// Copies image `index` to `pixels` as soon as it is rendered; false if the reader renders the
    /// image itself.
    pub fn take(&mut self, drive: &SimulatedDrive, index: usize, pixels: &mut [u8]) -> bool {
        if !std::mem::replace(&mut self.looked, true) {
            return false;
        }
        let goes_on = self.coming.front().is_some_and(|(at, _)| *at <= index);
        for (at, image) in std::mem::take(&mut self.coming) {
            match goes_on && at >= index {
                true => self.coming.push_back((at, image)),
                // Waits, or a reader that jumps would start ever more threads.
                false => drop(image.join()),
            }
        }
        let next = self.coming.back().map_or(index, |(last, _)| last + 1);
        for at in next..(index + AHEAD).min(drive.scans()) {
            self.coming.push_back((at, start(drive.clone(), at)));
        }
        let rendered = self.coming.pop_front().map(|(_, image)| image.join());
        if let Some(Ok(image)) = &rendered {
            pixels.copy_from_slice(image);
        }
        matches!(rendered, Some(Ok(_)))
    }
}

fn start(drive: SimulatedDrive, index: usize) -> JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        // On Linux this concerns this thread alone.
        let _ = rustix::process::nice(NICENESS);
        let mut pixels = vec![0; drive.image_size().bytes()];
        drive.renderer().draw(index, &mut pixels);
        pixels
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimulationConfig;

    #[test]
    fn images_read_in_any_order_are_those_rendered_alone() {
        let drive = SimulatedDrive::new(&SimulationConfig {
            scans: Some(12),
            ..SimulationConfig::default()
        })
        .unwrap();
        let (mut ahead, mut alone) = (drive.renderer_ahead(), drive.renderer());
        let (mut a, mut b) = (vec![0; ahead.size().bytes()], vec![0; ahead.size().bytes()]);
        for index in [0, 0, 1, 2, 9, 10, 3, 3, 5, 11] {
            ahead.draw(index, &mut a);
            alone.draw(index, &mut b);
            assert!(a == b, "image {index}");
        }
    }
}
