use nalgebra::Vector2;

/// The energy that is left of a raster in the overlap, for shifts of up to `reach` cells each way.
///
/// It is built from sums over rows, columns and the four corners, since there are far fewer shifts
/// than cells.
#[derive(Debug, Clone)]
pub(crate) struct OverlapEnergy {
    n: usize,
    reach: usize,
    rows: Vec<f32>,
    columns: Vec<f32>,
    edges: [Vec<f64>; 4],
    /// Sums over b columns of the rows of one corner so far.
    corner: Vec<f64>,
    /// Energy left after each shift (down, right), row after row from the most negative on: `down`
    /// rows are dropped at the top (at the bottom if negative), `right` columns at the left (at the
    /// right).
    pub left: Vec<f64>,
    pub total: f64,
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
            edges: std::array::from_fn(|_| vec![0.0; side]),
            corner: vec![0.0; side],
            left: vec![0.0; (2 * reach + 1).pow(2)],
            total: 0.0,
        }
    }

    /// Centre of the energy, cells down and right of the middle; zero without energy.
    pub fn centre(&self) -> Vector2<f64> {
        let moment = |sums: &[f32]| -> f64 {
            sums.iter()
                .enumerate()
                .map(|(k, &e)| (k as f64 - (self.n - 1) as f64 / 2.0) * f64::from(e))
                .sum()
        };
        if self.total > 0.0 {
            Vector2::new(moment(&self.rows), moment(&self.columns)) / self.total
        } else {
            Vector2::zeros()
        }
    }

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
        for (vertical, horizontal) in [(TOP, LEFT), (TOP, RIGHT), (BOTTOM, LEFT), (BOTTOM, RIGHT)] {
            self.measure_corner(vertical, horizontal, raster);
        }
    }

    /// Fills in the energy left after the shifts that drop cells at two of the edges: a rows and b
    /// columns are dropped, and the a x b cells of the corner are in both.
    fn measure_corner(&mut self, vertical: usize, horizontal: usize, raster: &[f32]) {
        let (n, side, middle) = (self.n, self.reach + 1, self.left.len() / 2);
        let (rows, columns) = (&self.edges[vertical], &self.edges[horizontal]);
        self.corner.fill(0.0);
        for (a, &above) in rows.iter().enumerate().take(side) {
            let row = if vertical == TOP {
                a.wrapping_sub(1)
            } else {
                n - a
            };
            let down = a * (2 * side - 1);
            let line = if vertical == TOP {
                middle + down
            } else {
                middle - down
            };
            let mut along = 0.0;
            for (b, &beside) in columns.iter().enumerate().take(side) {
                if a > 0 && b > 0 {
                    let col = if horizontal == LEFT { b - 1 } else { n - b };
                    along += f64::from(raster[row * n + col]).powi(2);
                    self.corner[b] += along;
                }
                let lost = above + beside - self.corner[b];
                let place = if horizontal == LEFT {
                    line + b
                } else {
                    line - b
                };
                self.left[place] = (self.total - lost).max(0.0);
            }
        }
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
            if lost >= 0 {
                k >= lost.unsigned_abs()
            } else {
                k < n - lost.unsigned_abs()
            }
        };
        for down in -5..=5 {
            for right in -5..=5 {
                let direct: f64 = (0..n * n)
                    .filter(|k| kept(k / n, down) && kept(k % n, right))
                    .map(|k| f64::from(raster[k]).powi(2))
                    .sum();
                let got = energy.left[((down + 5) * 11 + right + 5) as usize];
                assert!(
                    (got - direct).abs() <= 1e-6 * direct,
                    "{down} {right}: {got} {direct}"
                );
            }
        }
    }
}
