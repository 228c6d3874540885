//! Interpolation of peaks: the position, height and curvature of the maximum of a sampled
//! correlation.
//!
//! A parabola through three samples is pulled toward the middle one, by up to 0.1 of a step where
//! the peak is narrow. Correlations of radar scans are closer to Gaussians over a pedestal, whose
//! logarithm is a parabola.

use nalgebra::{Matrix2, Vector2};

use crate::config::Peak;

/// Samples on each side of the highest one that a fit uses.
pub(crate) const SUPPORT: usize = 3;

/// The largest distance of a fitted peak from the highest sample, samples.
const MAX_OFFSET: f64 = 0.75;

/// The pedestal lies below the lowest sample by this share of the range, so that the logarithm
/// exists.
const PEDESTAL_MARGIN: f64 = 0.05;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinePeak {
    /// Position, in samples from the highest one.
    pub offset: f64,
    pub value: f64,
    /// Second derivative there, per squared sample.
    pub curvature: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlanePeak {
    /// Position (row, column), in samples from the highest one.
    pub offset: Vector2<f64>,
    pub value: f64,
    /// Second derivatives there, per squared sample.
    pub hessian: Matrix2<f64>,
}

/// The maximum next to the highest sample, `sample(0)`, of a line.
pub fn line_peak(kind: Peak, sample: impl Fn(isize) -> f64) -> LinePeak {
    let near = [sample(-1), sample(0), sample(1)];
    if kind == Peak::Parabola {
        return line_parabola(near);
    }
    let reach = SUPPORT as isize;
    let level = pedestal((-reach..=reach).map(&sample), near[1]);
    let log = line_parabola(near.map(|v| (v - level).ln()));
    if log.curvature.is_nan() || log.curvature >= 0.0 {
        return line_parabola(near);
    }
    let height = log.value.exp();
    LinePeak {
        offset: log.offset,
        value: level + height,
        curvature: height * log.curvature,
    }
}

/// The maximum next to the highest sample, `sample(0, 0)`, of a plane.
pub(crate) fn plane_peak(kind: Peak, sample: impl Fn(isize, isize) -> f64) -> PlanePeak {
    let near =
        std::array::from_fn(|i| std::array::from_fn(|j| sample(i as isize - 1, j as isize - 1)));
    if kind == Peak::Parabola {
        return plane_parabola(near);
    }
    let reach = SUPPORT as isize;
    let level = pedestal(
        (-reach..=reach)
            .flat_map(|i| (-reach..=reach).map(move |j| (i, j)))
            .map(|(i, j)| sample(i, j)),
        near[1][1],
    );
    match paraboloid(near.map(|row: [f64; 3]| row.map(|v| (v - level).ln()))) {
        Some(log) => {
            let height = log.value.exp();
            PlanePeak {
                offset: log.offset,
                value: level + height,
                hessian: log.hessian * height,
            }
        }
        None => plane_parabola(near),
    }
}

fn pedestal(around: impl Iterator<Item = f64>, highest: f64) -> f64 {
    let lowest = around.fold(highest, f64::min);
    lowest - PEDESTAL_MARGIN * (highest - lowest)
}

fn line_parabola([a, b, c]: [f64; 3]) -> LinePeak {
    let curvature = a - 2.0 * b + c;
    let offset = if curvature < 0.0 {
        (0.5 * (a - c) / curvature).clamp(-MAX_OFFSET, MAX_OFFSET)
    } else {
        0.0
    };
    LinePeak {
        offset,
        value: b - 0.25 * (a - c) * offset,
        curvature,
    }
}

/// The maximum of one parabola through three samples of each axis; the corners give the cross term.
fn plane_parabola(near: [[f64; 3]; 3]) -> PlanePeak {
    let down = line_parabola([near[0][1], near[1][1], near[2][1]]);
    let right = line_parabola(near[1]);
    let cross = 0.25 * (near[2][2] - near[2][0] - near[0][2] + near[0][0]);
    PlanePeak {
        offset: Vector2::new(down.offset, right.offset),
        value: down.value + right.value - near[1][1],
        hessian: Matrix2::new(down.curvature, cross, cross, right.curvature),
    }
}

/// The maximum of the least-squares paraboloid of nine samples; `None` if it has none nearby.
fn paraboloid(near: [[f64; 3]; 3]) -> Option<PlanePeak> {
    let sum = |weight: fn(f64, f64) -> f64| -> f64 {
        (0..9)
            .map(|k| weight((k / 3) as f64 - 1.0, (k % 3) as f64 - 1.0) * near[k / 3][k % 3])
            .sum()
    };
    let gradient = Vector2::new(sum(|i, _| i), sum(|_, j| j)) / 6.0;
    let cross = sum(|i, j| i * j) / 4.0;
    let hessian = Matrix2::new(
        sum(|i, _| 3.0 * i * i - 2.0) / 3.0,
        cross,
        cross,
        sum(|_, j| 3.0 * j * j - 2.0) / 3.0,
    );
    let mean = sum(|i, j| 5.0 - 3.0 * (i * i + j * j)) / 9.0;
    let offset = hessian.try_inverse()? * -gradient;
    let summit =
        hessian[(0, 0)] < 0.0 && hessian.determinant() > 0.0 && offset.amax() <= MAX_OFFSET;
    summit.then(|| PlanePeak {
        offset,
        value: mean + 0.5 * gradient.dot(&offset),
        hessian,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian of deviation `width` over a broad hill, the shape of a real correlation.
    fn bump(t: f64, width: f64) -> f64 {
        0.4 * (-0.5 * (t / width).powi(2)).exp() + 0.6 * (-0.5 * (t / 9.0).powi(2)).exp()
    }

    #[test]
    fn gaussian_peaks_of_any_width_are_placed_to_a_fiftieth_of_a_step() {
        for width in [0.7, 0.8, 1.0, 1.5, 2.0] {
            for k in -5..=5 {
                let at = f64::from(k) / 10.0;
                let peak = line_peak(Peak::Gaussian, |j| bump(j as f64 - at, width));
                assert!((peak.offset - at).abs() < 0.02, "{width} {at}: {peak:?}");
                assert!((peak.value - 1.0).abs() < 0.04, "{width} {at}: {peak:?}");
            }
        }
    }

    #[test]
    fn curvature_is_the_second_derivative_at_the_summit() {
        let peak = line_peak(Peak::Gaussian, |j| {
            3.0 + (-0.5 * (j as f64 / 1.3).powi(2)).exp()
        });
        assert!((peak.curvature * 1.69 + 1.0).abs() < 0.05, "{peak:?}");
    }

    #[test]
    fn elongated_peak_keeps_its_orientation() {
        let f =
            |u: f64, v: f64| (-0.5 * ((u + v) / 2.5).powi(2) - 0.5 * ((u - v) / 1.2).powi(2)).exp();
        for (kind, tolerance) in [(Peak::Gaussian, 0.02), (Peak::Parabola, 0.25)] {
            let peak = plane_peak(kind, |i, j| f(i as f64 - 0.3, j as f64 + 0.2));
            assert!(
                (peak.offset - Vector2::new(0.3, -0.2)).amax() < tolerance,
                "{kind:?} {peak:?}"
            );
            let want = Matrix2::new(-0.85, 0.53, 0.53, -0.85);
            assert!(
                (peak.hessian - want).amax() < 0.4 && peak.hessian[(0, 1)] > 0.15,
                "{kind:?} {peak:?}"
            );
        }
    }

    #[test]
    fn samples_without_a_peak_stay_where_they_are() {
        for kind in [Peak::Gaussian, Peak::Parabola] {
            for level in [0.0, 1.0, f64::NAN] {
                assert_eq!(line_peak(kind, |_| level).offset, 0.0);
                assert_eq!(plane_peak(kind, |_, _| level).offset, Vector2::zeros());
            }
        }
    }
}
