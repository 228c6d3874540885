use std::f64::consts::PI;

use crate::config::Taper;

/// The weights of an n x n raster, row by row.
pub(crate) fn weights(window: Taper, n: usize) -> Vec<f32> {
    let middle = (n - 1) as f64 / 2.0;
    let half = (n as f64 + 1.0) / 2.0;
    let hann = |t: f64| {
        if t.abs() < half {
            0.5 + 0.5 * (PI * t / half).cos()
        } else {
            0.0
        }
    };
    let at = |row: usize, col: usize| {
        let (u, v) = (row as f64 - middle, col as f64 - middle);
        match window {
            Taper::None => 1.0,
            Taper::Hann => hann(u) * hann(v),
            Taper::RadialHann => hann(u.hypot(v)),
        }
    };
    (0..n * n).map(|k| at(k / n, k % n) as f32).collect()
}
