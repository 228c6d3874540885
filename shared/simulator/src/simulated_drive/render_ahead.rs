//! Images of a simulated drive, rendered before they are needed.
//!
//! One thread per processor renders the next image that no other has begun, up to [`AHEAD`] images
//! ahead of the reader. So memory is bounded; and since an image depends on its number alone,
//! threads and their timing change nothing.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

use gyre_datasets::ImageSource as _;

use crate::simulated_drive::{Renderer, SimulatedDrive};

/// Images rendered or being rendered that have not been read yet.
const AHEAD: usize = 6;
/// The renderers yield to the stages: on a vehicle the radar does their work.
const NICENESS: i32 = 10;

/// The images ahead of a reader. They may be read in any order; consecutive ones are fast.
#[derive(Default)]
pub(crate) struct Ahead {
    /// Started with the second image: a reader may need the first only to inspect the recording.
    crew: Option<Crew>,
    looked: bool,
}

impl Ahead {
    /// Copies image `index` to `pixels` as soon as it is rendered; false if the reader renders the
    /// image itself.
    pub fn take(&mut self, drive: &SimulatedDrive, index: usize, pixels: &mut [u8]) -> bool {
        let looked = std::mem::replace(&mut self.looked, true);
        if looked {
            let crew = self.crew.get_or_insert_with(|| Crew::start(drive, index));
            crew.take(index, pixels);
        }
        looked
    }
}

struct Crew {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

/// The rendered scans, and the next scans to render and to read.
#[derive(Default)]
struct Queue {
    images: usize,
    /// The image that is asked for next.
    wanted: usize,
    next: usize,
    ready: BTreeMap<usize, Vec<u8>>,
    spare: Vec<Vec<u8>>,
    stop: bool,
}

impl Queue {
    /// The next image to render, where there is room for one.
    fn claim(&mut self) -> Option<usize> {
        let index = self.next;
        let room = index < self.images && index < self.wanted + AHEAD;
        self.next += usize::from(room);
        room.then_some(index)
    }

    /// Forgets what lies before `index`; all, where that has not been begun.
    fn turn_to(&mut self, index: usize) {
        let begun = (self.wanted..self.next).contains(&index);
        self.wanted = index;
        if !begun {
            self.next = index;
        }
        let (wanted, end) = (self.wanted, self.next);
        while let Some(entry) = self
            .ready
            .first_entry()
            .filter(|entry| *entry.key() < wanted)
        {
            self.spare.push(entry.remove());
        }
        while let Some(entry) = self.ready.last_entry().filter(|entry| *entry.key() >= end) {
            self.spare.push(entry.remove());
        }
    }

    /// Keeps an image, unless it is not wanted any more.
    fn keep(&mut self, index: usize, pixels: Vec<u8>) {
        let superseded = match (self.wanted..self.next).contains(&index) {
            true => self.ready.insert(index, pixels),
            false => Some(pixels),
        };
        self.spare.extend(superseded);
    }
}

impl Shared {
    /// The queue is consistent even after a panic: nothing that can fail is done while it is
    /// locked.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, queue: MutexGuard<'a, Queue>) -> MutexGuard<'a, Queue> {
        self.changed
            .wait(queue)
            .unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self, mut renderer: Renderer) {
        let bytes = renderer.size().bytes();
        let mut queue = self.lock();
        while !queue.stop {
            let Some(index) = queue.claim() else {
                queue = self.wait(queue);
                continue;
            };
            let spare = queue.spare.pop();
            drop(queue);
            let mut pixels = spare.unwrap_or_else(|| vec![0; bytes]);
            renderer.draw(index, &mut pixels);
            queue = self.lock();
            queue.keep(index, pixels);
            self.changed.notify_all();
        }
    }
}

impl Crew {
    fn start(drive: &SimulatedDrive, first: usize) -> Self {
        let queue = Queue {
            images: drive.scans(),
            wanted: first,
            next: first,
            ..Queue::default()
        };
        let shared = Arc::new(Shared {
            queue: Mutex::new(queue),
            changed: Condvar::new(),
        });
        let threads = thread::available_parallelism().map_or(1, |n| n.get());
        let start = |_| {
            let (shared, renderer) = (shared.clone(), drive.renderer());
            thread::spawn(move || {
                // On Linux this concerns this thread alone.
                let _ = rustix::process::nice(NICENESS);
                shared.work(renderer);
            })
        };
        Self {
            threads: (0..threads).map(start).collect(),
            shared,
        }
    }

    fn take(&self, index: usize, pixels: &mut [u8]) {
        let mut queue = self.shared.lock();
        queue.turn_to(index);
        self.shared.changed.notify_all();
        let image = loop {
            match queue.ready.remove(&index) {
                Some(image) => break image,
                None => queue = self.shared.wait(queue),
            }
        };
        pixels.copy_from_slice(&image);
        queue.spare.push(image);
        queue.wanted = index + 1;
        self.shared.changed.notify_all();
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        self.shared.lock().stop = true;
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
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

    #[test]
    fn no_more_is_rendered_than_there_is_room_for() {
        let mut queue = Queue {
            images: 100,
            wanted: 3,
            next: 3,
            ..Queue::default()
        };
        let claimed: Vec<usize> = std::iter::from_fn(|| queue.claim()).collect();
        assert_eq!(claimed, (3..3 + AHEAD).collect::<Vec<_>>());
        for index in claimed {
            queue.keep(index, vec![index as u8]);
        }
        queue.turn_to(5);
        assert_eq!((queue.ready.len(), queue.spare.len()), (AHEAD - 2, 2));
        queue.turn_to(50);
        queue.keep(6, vec![6]);
        assert_eq!(
            (queue.ready.len(), queue.spare.len(), queue.claim()),
            (0, AHEAD + 1, Some(50))
        );
    }
}
