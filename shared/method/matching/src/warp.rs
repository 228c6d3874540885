/// A rotation of rasters of n x n cells about their middle, and a shift, with bilinear
/// interpolation.
#[derive(Debug, Clone)]
pub(crate) struct Rotation {
    n: usize,
    cos: f64,
    sin: f64,
    /// Added to the position of each lookup, down and to the right, cells.
    offset: [f64; 2],
}

/// The columns of one row whose source lies inside the raster, and that source.
#[derive(Debug, Clone, Copy)]
struct Span {
    first: usize,
    end: usize,
    /// Source of column 0, and the step from column to column, in cells.
    row: f64,
    col: f64,
    row_step: f64,
    col_step: f64,
}

impl Rotation {
    pub fn new(n: usize, angle_rad: f64) -> Self {
        let (sin, cos) = angle_rad.sin_cos();
        Self {
            n,
            cos,
            sin,
            offset: [0.0; 2],
        }
    }

    pub fn with_offset(self, offset: [f64; 2]) -> Self {
        Self { offset, ..self }
    }

    /// Writes row `r` of g'(x) = g(R x); zero where R x lies outside g (Weston et al., Algorithm 1,
    /// line 16).
    pub fn row(&self, g: &[f32], r: usize, out: &mut [f32]) {
        let span = self.span(r);
        out[..span.first].fill(0.0);
        out[span.end..].fill(0.0);
        if span.first < span.end {
            crate::kernels::bilinear_line(
                g,
                self.n,
                [
                    span.row + span.first as f64 * span.row_step,
                    span.col + span.first as f64 * span.col_step,
                ],
                [span.row_step, span.col_step],
                &mut out[span.first..span.end],
            );
        }
    }

    /// With u, v the cells down and right of the middle, x = -u and y = -v, so the source is u' =
    /// cos u - sin v, v' = sin u + cos v.
    fn span(&self, r: usize) -> Span {
        let last = (self.n - 1) as f64;
        let middle = last / 2.0;
        let u = r as f64 - middle;
        let row = middle + self.offset[0] + self.cos * u + self.sin * middle;
        let col = middle + self.offset[1] + self.sin * u - self.cos * middle;
        let (row_step, col_step) = (-self.sin, self.cos);
        let (a, b) = inside(row, row_step, last);
        let (c, d) = inside(col, col_step, last);
        let first = a.max(c).max(0.0).ceil() as usize;
        let end = (b.min(d).min(last).floor() + 1.0).max(0.0) as usize;
        Span {
            first: first.min(self.n),
            end: end.max(first).min(self.n),
            row,
            col,
            row_step,
            col_step,
        }
    }
}

/// The interval of k with 0 <= start + k step <= last, with a millionth of a cell of tolerance for
/// rounding.
fn inside(start: f64, step: f64, last: f64) -> (f64, f64) {
    const TOLERANCE: f64 = 1e-6;
    if step.abs() < 1e-12 {
        let within = start >= -TOLERANCE && start <= last + TOLERANCE;
        return if within { (0.0, last) } else { (1.0, 0.0) };
    }
    let (a, b) = (
        (-TOLERANCE - start) / step,
        (last + TOLERANCE - start) / step,
    );
    (a.min(b), a.max(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(g: &[f32], n: usize, angle: f64) -> Vec<f32> {
        let rotation = Rotation::new(n, angle);
        let mut out = vec![9.0; n * n];
        out.chunks_exact_mut(n)
            .enumerate()
            .for_each(|(r, row)| rotation.row(g, r, row));
        out
    }

    #[test]
    fn no_rotation_is_the_identity_to_the_last_cell() {
        let g: Vec<f32> = (0..17 * 17).map(|k| k as f32).collect();
        assert_eq!(turned(&g, 17, 0.0), g);
    }

    #[test]
    fn matches_a_direct_lookup_at_every_angle() {
        let n = 33;
        let g: Vec<f32> = (0..n * n).map(|k| ((k * 7919) % 101) as f32).collect();
        for degrees in (-180..=180).step_by(7) {
            let angle = f64::from(degrees).to_radians();
            let out = turned(&g, n, angle);
            let (s, c) = angle.sin_cos();
            for r in 0..n {
                for k in 0..n {
                    let (u, v) = (r as f64 - 16.0, k as f64 - 16.0);
                    let (su, sv) = (16.0 + c * u - s * v, 16.0 + s * u + c * v);
                    let (i, j) = (su.floor(), sv.floor());
                    if i < 0.0 || j < 0.0 || i > 31.0 || j > 31.0 {
                        continue;
                    }
                    let (a, b, at) = (su - i, sv - j, i as usize * n + j as usize);
                    let [p, q, x, y] = [at, at + 1, at + n, at + n + 1].map(|k| f64::from(g[k]));
                    let want = (1.0 - a) * ((1.0 - b) * p + b * q) + a * ((1.0 - b) * x + b * y);
                    assert!(
                        (f64::from(out[r * n + k]) - want).abs() < 0.02,
                        "{degrees} {r} {k}"
                    );
                }
            }
        }
    }
}
