use std::f64::consts::TAU;

use gyre_matching::Submap;
use ndarray::{Array2, ArrayView2};

const SECTORS: usize = 72;
/// A span of empty sectors is hidden if it is at least this wide, sectors: 60 degrees. Shorter ones
/// occur on open ground.
const HIDDEN: usize = 12;

/// The cells of a raster that a sensor could see. A vehicle's roof, a wall or a broken sensor hides
/// a part of the turn, so the map's contents there are no evidence against a place.
pub(crate) struct Sight {
    sectors: Array2<u8>,
    /// 1 in the cells that could be seen, 0 elsewhere.
    seen: Array2<f32>,
    is_whole: bool,
}

impl Sight {
    pub fn new(n: usize) -> Self {
        let middle = 0.5 * (n as f64 - 1.0);
        let sector_of = |(row, column)| sector(middle - row as f64, middle - column as f64) as u8;
        Self {
            sectors: Array2::from_shape_fn((n, n), sector_of),
            seen: Array2::ones((n, n)),
            is_whole: true,
        }
    }

    pub fn look(&mut self, scan: &Submap) {
        let mut saw = [false; SECTORS];
        for [x_m, y_m, _] in scan.points() {
            saw[sector(f64::from(x_m), f64::from(y_m))] = true;
        }
        let hidden = hidden(&saw);
        self.is_whole = !hidden.contains(&true);
        let cells = self.seen.iter_mut().zip(&self.sectors);
        cells.for_each(|(seen, sector)| *seen = f32::from(!hidden[usize::from(*sector)]));
    }

    /// Returns 1 in each cell that could be seen, 0 elsewhere, row 0 far ahead; `None` if all could
    /// be.
    pub fn seen(&self) -> Option<ArrayView2<'_, f32>> {
        (!self.is_whole).then(|| self.seen.view())
    }
}

fn sector(x: f64, y: f64) -> usize {
    let turn = y.atan2(x).rem_euclid(TAU) / TAU;
    ((turn * SECTORS as f64) as usize).min(SECTORS - 1)
}

/// The empty sectors that lie in a wide span of such.
fn hidden(saw: &[bool; SECTORS]) -> [bool; SECTORS] {
    let mut hidden = [false; SECTORS];
    for first in 0..SECTORS {
        let span = || (first..first + HIDDEN).map(|k| k % SECTORS);
        if span().all(|k| !saw[k]) {
            span().for_each(|k| hidden[k] = true);
        }
    }
    hidden
}

#[cfg(test)]
mod tests {
    use gyre_geometry::{SparsePoint, Twist};

    use super::*;

    fn scan(first: u16, last: u16) -> Submap {
        let point = |degrees: u16| {
            let (sin, cos) = f32::from(degrees).to_radians().sin_cos();
            SparsePoint::from([20.0 * cos, 20.0 * sin, 0.0, 1.0, 0.0])
        };
        let points: Vec<_> = (first..last).map(point).collect();
        let mut submap = Submap::default();
        submap.start(&points, &Twist::default());
        submap
    }

    #[test]
    fn what_is_hidden_to_the_right_of_the_sensor_is_no_part_of_the_raster() {
        let mut sight = Sight::new(21);
        sight.look(&scan(0, 360));
        assert!(sight.seen().is_none());
        sight.look(&scan(0, 180));
        let seen = sight
            .seen()
            .map(|seen| [seen[[10, 2]], seen[[10, 18]], seen[[2, 9]]]);
        assert_eq!(seen, Some([1.0, 0.0, 1.0]));
    }

    #[test]
    fn a_narrow_gap_is_open_ground() {
        let mut sight = Sight::new(21);
        sight.look(&scan(0, 310));
        assert!(sight.seen().is_none());
        sight.look(&scan(0, 290));
        assert!(sight.seen().is_some());
    }

    #[test]
    fn a_scan_without_points_has_seen_nothing() {
        let mut sight = Sight::new(21);
        sight.look(&Submap::default());
        assert_eq!(sight.seen().map(|seen| seen.sum()), Some(0.0));
    }
}
