//! Processes that are started one after the other, as the stage is, with one file.

use super::*;

/// A small map with a keyframe for each second scan: slots are reused after about twenty scans.
fn small() -> RefinementConfig {
    RefinementConfig {
        keyframes: 2,
        reach_m: 30.0,
        ..config()
    }
}

const DRIVE: u64 = 60;

/// The scan of two rows of posts, `metres` along the road.
fn posts(metres: f64) -> Vec<SparsePoint> {
    let post = |k: i32| {
        [
            f64::from(7 * k % 29) * 7.0 - metres % 7.0 - 90.0,
            f64::from(k % 5 * 4 - 10),
        ]
    };
    let near = |[x, _]: &[f64; 2]| x.abs() < 28.0;
    (0..60)
        .map(post)
        .filter(near)
        .map(|[x, y]| [x as f32, y as f32, 0.0, 1.0, 0.0].into())
        .collect()
}

/// A process of the stage, which shares its file with the processes before and after it.
struct Process {
    refiner: Refiner,
    checkpoint: Checkpoint,
    next: Option<u64>,
}

impl Process {
    fn start(path: &Path) -> Self {
        Self {
            refiner: Refiner::new(&small(), &SensorConfigs::default(), 512).unwrap(),
            checkpoint: open_with(path, &small(), 2),
            next: None,
        }
    }

    /// Processes these items of a drive at `speed` metres per scan; returns the bits of the
    /// motions.
    fn items(&mut self, items: impl IntoIterator<Item = u64>, speed: f64) -> Vec<[u64; 3]> {
        items
            .into_iter()
            .map(|item| self.item(item, speed))
            .collect()
    }

    fn item(&mut self, item: u64, speed: f64) -> [u64; 3] {
        if self.next != Some(item) && item > 0 {
            self.checkpoint
                .restore(item - 1, &mut self.refiner)
                .unwrap();
        }
        self.next = Some(item + 1);
        let motion = match item.checked_sub(1) {
            None => {
                self.refiner.reset();
                Isometry2::identity()
            }
            Some(previous) => {
                let [later, earlier] = [item, previous].map(|k| posts(k as f64 * speed));
                let searched = Isometry2::new(Vector2::new(speed, 0.0), 0.0);
                self.refiner
                    .refine(&Searched::by_radar(
                        item, &later, &earlier, &searched, INTERVAL_S,
                    ))
                    .motion
                    .motion
            }
        };
        self.checkpoint.write(item, 0, &self.refiner).unwrap();
        [
            motion.translation.x,
            motion.translation.y,
            motion.rotation.angle(),
        ]
        .map(f64::to_bits)
    }
}

/// A restarted process may repeat any number of items before the next restart, which can begin at
/// any of them.
#[test]
fn a_process_resumes_from_any_item_of_earlier_processes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let alone = Process::start(&path("alone")).items(0..DRIVE, 1.0);
    for reached in (1..DRIVE - 2).step_by(2) {
        for repeated in 0..4 {
            let path = path(&format!("{reached}-{repeated}"));
            Process::start(&path).items(0..=reached, 1.0);
            let from = reached.saturating_sub(3);
            Process::start(&path).items(from..(from + repeated).min(reached + 1), 1.0);
            for first in (from..=reached + 1).rev() {
                let motions = Process::start(&path).items(first..reached + 2, 1.0);
                let expected = &alone[first as usize..reached as usize + 2];
                assert_eq!(
                    motions, expected,
                    "from {first}, {reached} reached before, {repeated} repeated"
                );
            }
        }
    }
}

/// In live mode a restarted source may drop scans that it had published before.
#[test]
fn states_of_other_scans_are_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for from in [0, 1, 2, 3, 20, 21] {
        let mut alone = Process::start(&path(&format!("alone-{from}")));
        alone.items(0..from, 1.0);
        let alone = alone.items(from..DRIVE, 2.0);
        for reached in from..from + 3 {
            let path = path(&format!("{from}-{reached}"));
            Process::start(&path).items(0..from + 3, 1.0);
            let mut motions = Process::start(&path).items(from..=reached, 2.0);
            motions.extend(Process::start(&path).items(reached + 1..DRIVE, 2.0));
            assert_eq!(motions, alone, "from {from}, killed again after {reached}");
        }
    }
}
