#![allow(clippy::unwrap_used)]
use gyre_geometry::SparsePoint;
use gyre_scan_matching::RefinementConfig;

use nalgebra::Vector2;

use super::*;

const WINDOW: usize = 2;
const SCANS: u64 = 60;
const INTERVAL_S: f64 = 0.25;

/// A small map, each scan a keyframe of it: slots are used again every ten scans or so.
fn config() -> RefinementConfig {
    RefinementConfig {
        keyframes: 2,
        keyframe_distance_m: 0.5,
        cell_m: 1.0,
        reach_m: 30.0,
        ..Default::default()
    }
}

/// What the vehicle sees of two rows of posts, `metres` along its way.
fn scan(metres: f64) -> Vec<SparsePoint> {
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

/// A process of the stage: what it knows, and the file it shares with the processes before and after.
struct Life {
    refinement: Refiner,
    checkpoint: Checkpoint,
    next: Option<u64>,
}

impl Life {
    fn begin(path: &Path) -> Self {
        let refinement = Refiner::new(&config(), 100).unwrap();
        let checkpoint = Checkpoint::open(
            path,
            WINDOW,
            config().keyframes,
            refinement.keyframe_cells(),
        )
        .unwrap();
        Self {
            refinement,
            checkpoint,
            next: None,
        }
    }

    /// Works through these items of a drive at `speed` metres a scan; the motions, to the bit.
    fn items(&mut self, items: impl IntoIterator<Item = u64>, speed: f64) -> Vec<[u64; 3]> {
        items
            .into_iter()
            .map(|item| self.item(item, speed))
            .collect()
    }

    fn item(&mut self, item: u64, speed: f64) -> [u64; 3] {
        if self.next != Some(item) && item > 0 {
            self.checkpoint
                .restore(item - 1, &mut self.refinement)
                .unwrap();
        }
        self.next = Some(item + 1);
        let motion = match item.checked_sub(1) {
            None => {
                self.refinement.reset();
                Isometry2::identity()
            }
            Some(before) => {
                let [later, earlier] = [item, before].map(|k| scan(k as f64 * speed));
                let searched = Isometry2::new(Vector2::new(speed, 0.0), 0.0);
                self.refinement
                    .refine(item, &later, &earlier, &searched, INTERVAL_S)
                    .motion
                    .motion
            }
        };
        self.checkpoint.write(item, &self.refinement).unwrap();
        [
            motion.translation.x,
            motion.translation.y,
            motion.rotation.angle(),
        ]
        .map(f64::to_bits)
    }
}

/// However far a life gets through what the one before had done, the next can start anywhere behind.
#[test]
fn a_life_goes_on_where_any_life_before_it_stood() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let alone = Life::begin(&path("alone")).items(0..SCANS, 1.0);
    for reached in (1..SCANS - 2).step_by(2) {
        for repeated in 0..4 {
            let path = path(&format!("{reached}-{repeated}"));
            Life::begin(&path).items(0..=reached, 1.0);
            let from = reached.saturating_sub(3);
            Life::begin(&path).items(from..(from + repeated).min(reached + 1), 1.0);
            for first in (from..=reached + 1).rev() {
                let motions = Life::begin(&path).items(first..reached + 2, 1.0);
                let expected = &alone[first as usize..reached as usize + 2];
                assert_eq!(
                    motions, expected,
                    "from {first}, {reached} reached before, {repeated} of them again"
                );
            }
        }
    }
}

/// In live mode a restarted source may be late for the scans that it had played before.
#[test]
fn what_an_earlier_life_made_of_other_scans_is_of_no_use() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for from in [0, 1, 2, 3, 20, 21] {
        let mut alone = Life::begin(&path(&format!("alone-{from}")));
        alone.items(0..from, 1.0);
        let alone = alone.items(from..SCANS, 2.0);
        for reached in from..from + 3 {
            let path = path(&format!("{from}-{reached}"));
            Life::begin(&path).items(0..from + 3, 1.0);
            let mut motions = Life::begin(&path).items(from..=reached, 2.0);
            motions.extend(Life::begin(&path).items(reached + 1..SCANS, 2.0));
            assert_eq!(motions, alone, "from {from}, killed again after {reached}");
        }
    }
}
