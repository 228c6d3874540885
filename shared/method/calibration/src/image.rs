//! The image of a scan for comparison with other scans.

use nalgebra::Vector2;

/// Half width of the blur, in cells.
const REACH: usize = 3;

/// A blurred, saturated image of points, in the frame of their scan: 0 to 1.
pub(crate) struct Image {
    n: usize,
    per_m: f64,
    cells: Vec<f32>,
}

pub(crate) struct Reading {
    pub value: f64,
    pub slope: Vector2<f64>,
}

impl Image {
    /// Draws points (x, y, weight) within `reach_m`, blurred by a Gaussian of one cell.
    pub fn draw(points: &[[f64; 3]], cell_m: f64, reach_m: f64) -> Self {
        let n = 2 * (reach_m / cell_m).ceil() as usize + 2 * REACH + 2;
        let mut image = Self {
            n,
            per_m: 1.0 / cell_m,
            cells: vec![0.0; n * n],
        };
        points.iter().for_each(|point| image.splat(point));
        let blurred = blur(&image.cells, n, 1);
        image.cells = blur(&blurred, n, n);
        image.saturate();
        image
    }

    fn place(&self, at: Vector2<f64>) -> Option<(usize, [f64; 2])> {
        let middle = 0.5 * self.n as f64;
        let (u, v) = (at.x * self.per_m + middle, at.y * self.per_m + middle);
        let inside = REACH as f64..(self.n - REACH - 2) as f64;
        (inside.contains(&u) && inside.contains(&v)).then(|| {
            let (i, j) = (u as usize, v as usize);
            (i * self.n + j, [u - i as f64, v - j as f64])
        })
    }

    fn splat(&mut self, &[x, y, weight]: &[f64; 3]) {
        let Some((first, [a, b])) = self.place(Vector2::new(x, y)) else {
            return;
        };
        let n = self.n;
        for (cell, share) in [
            (first, (1.0 - a) * (1.0 - b)),
            (first + 1, (1.0 - a) * b),
            (first + n, a * (1.0 - b)),
            (first + n + 1, a * b),
        ] {
            self.cells[cell] += (weight * share) as f32;
        }
    }

    /// m / (m + mean): bright clutter must not outweigh the many faint returns.
    fn saturate(&mut self) {
        let sum: f64 = self.cells.iter().map(|m| f64::from(*m)).sum();
        let squares: f64 = self.cells.iter().map(|m| f64::from(*m).powi(2)).sum();
        let mean = if sum > 0.0 {
            (squares / sum) as f32
        } else {
            1.0
        };
        self.cells.iter_mut().for_each(|m| *m /= *m + mean);
    }

    /// Reads the image between its cells; `None` outside of it.
    pub fn read(&self, at: Vector2<f64>) -> Option<Reading> {
        let (first, [across, along]) = self.place(at)?;
        let cell = |k: usize| f64::from(self.cells[first + k]);
        let (a, b, c, d) = (cell(0), cell(1), cell(self.n), cell(self.n + 1));
        let (upper, lower) = (a + along * (b - a), c + along * (d - c));
        let (left, right) = (a + across * (c - a), b + across * (d - b));
        Some(Reading {
            value: upper + across * (lower - upper),
            slope: Vector2::new(lower - upper, right - left) * self.per_m,
        })
    }
}

fn blur(from: &[f32], n: usize, stride: usize) -> Vec<f32> {
    const WEIGHTS: [f32; 4] = [0.399_050_3, 0.242_036_2, 0.054_005_58, 0.004_433_048];
    let margin = REACH * n;
    let mut to = vec![0.0; from.len()];
    let at =
        |steps: usize| &from[margin + steps * stride - REACH * stride..][..from.len() - 2 * margin];
    let (a, b, c, d, e, f, g) = (at(0), at(1), at(2), at(3), at(4), at(5), at(6));
    let inner = &mut to[margin..from.len() - margin];
    for k in 0..inner.len() {
        inner[k] = WEIGHTS[0] * d[k]
            + WEIGHTS[1] * (c[k] + e[k])
            + WEIGHTS[2] * (b[k] + f[k])
            + WEIGHTS[3] * (a[k] + g[k]);
    }
    to
}
