//! What two shifted rasters have in common: the energy of each within the overlap.

use nalgebra::Vector2;

/// Energy of one raster in what is left of it after a shift, for shifts up to `reach` cells each way.
///
/// Built from sums over rows, columns and the four corners: the shifts are few beside the cells.
#[derive(Debug, Clone)]
pub(crate) struct OverlapEnergy {
    n: usize,
    reach: usize,
    rows: Vec<f32>,
    columns: Vec<f32>,
    /// Sums over a x b cells of each corner (top or bottom, left or right), a and b up to `reach`.
    corners: [Vec<f64>; 4],
    /// Sums over the first (last) k rows (columns).
    edges: [Vec<f64>; 4],
    total: f64,
}

const TOP: usize = 0;
const BOTTOM: usize = 1;
const LEFT: usize = 2;
const RIGHT: usize = 3;

impl OverlapEnergy {
    pub fn new(n: usize, reach: usize) -> Self {
        let side = reach + 1;
        Self {
            n,
            reach,
            rows: vec![0.0; n],
            columns: vec![0.0; n],
            corners: std::array::from_fn(|_| vec![0.0; side * side]),
            edges: std::array::from_fn(|_| vec![0.0; side]),
            total: 0.0,
        }
    }

    /// Energy of the whole raster.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Centre of the energy, cells down and right of the middle; zero where there is none.
    pub fn centre(&self) -> Vector2<f64> {
        let moment = |sums: &[f32]| -> f64 {
            sums.iter().enumerate().map(|(k, &e)| (k as f64 - (self.n - 1) as f64 / 2.0) * f64::from(e)).sum()
        };
        if self.total > 0.0 {
            Vector2::new(moment(&self.rows), moment(&self.columns)) / self.total
        } else {
            Vector2::zeros()
        }
    }

    /// Measures a raster.
    pub fn measure(&mut self, raster: &[f32]) {
        self.columns.fill(0.0);
        for (row, sum) in raster.chunks_exact(self.n).zip(&mut self.rows) {
            *sum = crate::kernels::add_squares(row, &mut self.columns);
        }
        self.total = self.rows.iter().map(|&e| f64::from(e)).sum();
        let n = self.n;
        for k in 0..self.reach {
            self.edges[TOP][k + 1] = self.edges[TOP][k] + f64::from(self.rows[k]);
            self.edges[BOTTOM][k + 1] = self.edges[BOTTOM][k] + f64::from(self.rows[n - 1 - k]);
            self.edges[LEFT][k + 1] = self.edges[LEFT][k] + f64::from(self.columns[k]);
            self.edges[RIGHT][k + 1] = self.edges[RIGHT][k] + f64::from(self.columns[n - 1 - k]);
        }
        for corner in 0..4 {
            self.measure_corner(corner, raster);
        }
    }

    fn measure_corner(&mut self, corner: usize, raster: &[f32]) {
        let (n, side) = (self.n, self.reach + 1);
        let sums = &mut self.corners[corner];
        for a in 1..side {
            let row = if corner / 2 == TOP { a - 1 } else { n - a };
            let mut along = 0.0;
            for b in 1..side {
                let col = if corner & 1 == 0 { b - 1 } else { n - b };
                along += f64::from(raster[row * n + col]).powi(2);
                sums[a * side + b] = sums[(a - 1) * side + b] + along;
            }
        }
    }

    /// Energy that is left when `down` rows fall out at the top (at the bottom where negative), and `right` columns
    /// at the left (at the right where negative).
    pub fn left_after(&self, down: isize, right: isize) -> f64 {
        let (a, b) = (down.unsigned_abs(), right.unsigned_abs());
        let vertical = if down >= 0 { TOP } else { BOTTOM };
        let horizontal = if right >= 0 { LEFT } else { RIGHT };
        let corner = 2 * vertical + (horizontal - LEFT);
        let lost = self.edges[vertical][a] + self.edges[horizontal][b] - self.corners[corner][a * (self.reach + 1) + b];
        (self.total - lost).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_a_direct_sum_for_every_shift() {
        let (n, reach) = (19_usize, 5_usize);
        let raster: Vec<f32> = (0..n * n).map(|k| ((k * 37) % 23) as f32).collect();
        let mut energy = OverlapEnergy::new(n, reach);
        for _ in 0..2 {
            energy.measure(&raster); // measuring again adds nothing
        }
        let kept = |k: usize, lost: isize| {
            if lost >= 0 { k >= lost.unsigned_abs() } else { k < n - lost.unsigned_abs() }
        };
        for down in -5..=5 {
            for right in -5..=5 {
                let direct: f64 = (0..n * n)
                    .filter(|k| kept(k / n, down) && kept(k % n, right))
                    .map(|k| f64::from(raster[k]).powi(2))
                    .sum();
                let got = energy.left_after(down, right);
                assert!((got - direct).abs() <= 1e-6 * direct, "{down} {right}: {got} {direct}");
            }
        }
    }
}
