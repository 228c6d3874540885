//! Smooth curves through noisy samples: penalised B-splines of degree five on evenly spaced knots.

use std::f64::consts::TAU;

/// Coefficients that influence one interval between knots.
const SUPPORT: usize = 6;
/// Entries of a row of the normal equations, from the diagonal on.
const BAND: usize = SUPPORT;
/// Penalty on first differences, relative to a sample's weight: determines coefficients without
/// samples.
const TINY: f64 = 1e-9;

#[derive(Clone, Copy, Debug)]
pub struct Sample<const D: usize> {
    /// The parameter of the curve: time or path length.
    pub at: f64,
    /// The coordinates there.
    pub value: [f64; D],
    pub weight: f64,
}

/// A curve in `D` coordinates whose derivatives are continuous up to the fourth. Evaluation takes
/// constant time.
#[derive(Clone, Debug)]
pub struct UniformSpline<const D: usize> {
    start: f64,
    step: f64,
    coefficients: Vec<[f64; D]>,
}

impl<const D: usize> UniformSpline<D> {
    /// Fits a curve with knots `step` apart to the samples, with a penalty on its third derivative
    /// (Eilers and Marx, "Flexible smoothing with B-splines and penalties", 1996): a low-pass
    /// filter with the frequency `cutoff`, periods a unit.
    /// The samples are in ascending order; without any the curve is zero.
    pub fn fit(samples: &[Sample<D>], step: f64, cutoff: f64) -> Self {
        let (start, end) = match samples {
            [first, .., last] => (first.at, last.at),
            [only] => (only.at, only.at),
            [] => (0.0, 0.0),
        };
        let intervals = ((end - start) / step).ceil().max(1.0) as usize;
        let mut curve = Self {
            start,
            step,
            coefficients: vec![[0.0; D]; intervals + SUPPORT - 1],
        };
        let mut normal = vec![[0.0; BAND]; curve.coefficients.len()];
        for sample in samples {
            curve.count(sample, &mut normal);
        }
        let density = samples.len() as f64 / (end - start).max(step);
        let stiffness = density / (TAU * cutoff).powi(6) / step.powi(5);
        penalise(&mut normal, &[-1.0, 3.0, -3.0, 1.0], stiffness);
        penalise(&mut normal, &[-1.0, 1.0], TINY);
        factorise(&mut normal);
        solve(&normal, &mut curve.coefficients);
        curve
    }

    /// The coordinates at a place; outside the samples the coordinates of the nearer end.
    pub fn value(&self, at: f64) -> [f64; D] {
        let (first, share) = self.locate(at);
        self.combine(first, &basis(share))
    }

    /// The first derivative at a place; unlike the value not clamped at the ends.
    pub fn slope(&self, at: f64) -> [f64; D] {
        let (first, share) = self.locate(at);
        self.combine(first, &basis_slope(share).map(|b| b / self.step))
    }

    /// The interval that contains a place, and the share of it before the place.
    fn locate(&self, at: f64) -> (usize, f64) {
        let intervals = self.coefficients.len() - (SUPPORT - 1);
        let along = ((at - self.start) / self.step).clamp(0.0, intervals as f64);
        let first = (along as usize).min(intervals - 1);
        (first, along - first as f64)
    }

    fn combine(&self, first: usize, weights: &[f64; SUPPORT]) -> [f64; D] {
        let mut sum = [0.0; D];
        for (coefficient, weight) in self.coefficients[first..first + SUPPORT]
            .iter()
            .zip(weights)
        {
            for (into, value) in sum.iter_mut().zip(coefficient) {
                *into += weight * value;
            }
        }
        sum
    }

    /// Adds a sample to the normal equations: the matrix in `normal`, the right-hand side in the
    /// coefficients.
    fn count(&mut self, sample: &Sample<D>, normal: &mut [[f64; BAND]]) {
        let (first, share) = self.locate(sample.at);
        let weights = basis(share);
        for (i, a) in weights.iter().enumerate() {
            for (j, b) in weights[i..].iter().enumerate() {
                normal[first + i][j] += sample.weight * a * b;
            }
            for (into, value) in self.coefficients[first + i].iter_mut().zip(sample.value) {
                *into += sample.weight * a * value;
            }
        }
    }
}

/// The six pieces of the B-spline of degree five, at the share `f` of an interval.
fn basis(f: f64) -> [f64; SUPPORT] {
    let g = 1.0 - f;
    let inner = |f: f64| 26.0 + f * (50.0 + f * (20.0 + f * (-20.0 + f * (-20.0 + f * 10.0))));
    let outer = |f: f64| 1.0 + f * (5.0 + f * (10.0 + f * (10.0 + f * (5.0 - f * 5.0))));
    [g.powi(5), outer(g), inner(g), inner(f), outer(f), f.powi(5)].map(|b| b / 120.0)
}

fn basis_slope(f: f64) -> [f64; SUPPORT] {
    let g = 1.0 - f;
    let inner = |f: f64| 50.0 + f * (40.0 + f * (-60.0 + f * (-80.0 + f * 50.0)));
    let outer = |f: f64| 5.0 + f * (20.0 + f * (30.0 + f * (20.0 - f * 25.0)));
    [
        -5.0 * g.powi(4),
        -outer(g),
        -inner(g),
        inner(f),
        outer(f),
        5.0 * f.powi(4),
    ]
    .map(|b| b / 120.0)
}

/// Adds the penalty `weight` on the squares of a difference of neighbouring coefficients.
fn penalise(normal: &mut [[f64; BAND]], difference: &[f64], weight: f64) {
    for first in 0..normal.len().saturating_sub(difference.len() - 1) {
        for (i, a) in difference.iter().enumerate() {
            for (j, b) in difference[i..].iter().enumerate() {
                normal[first + i][j] += weight * a * b;
            }
        }
    }
}

/// Replaces a positive definite band matrix by its factors L D L': D on the diagonal, the columns
/// of L beside it.
fn factorise(band: &mut [[f64; BAND]]) {
    for column in 0..band.len() {
        let row = band[column];
        let pivot = row[0].max(f64::MIN_POSITIVE);
        for i in 1..BAND.min(band.len() - column) {
            let factor = row[i] / pivot;
            for j in i..BAND {
                band[column + i][j - i] -= factor * row[j];
            }
            band[column][i] = factor;
        }
        band[column][0] = pivot;
    }
}

fn solve<const D: usize>(factors: &[[f64; BAND]], right: &mut [[f64; D]]) {
    let reach = |row: usize| BAND.min(factors.len() - row);
    let subtract = |from: [f64; D], factor: f64, what: [f64; D]| {
        std::array::from_fn(|d| from[d] - factor * what[d])
    };
    for row in 0..factors.len() {
        for i in 1..reach(row) {
            right[row + i] = subtract(right[row + i], factors[row][i], right[row]);
        }
    }
    for row in (0..factors.len()).rev() {
        right[row] = right[row].map(|value| value / factors[row][0]);
        for i in 1..reach(row) {
            right[row] = subtract(right[row], factors[row][i], right[row + i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn samples(of: impl Fn(f64) -> f64, count: usize, spacing: f64) -> Vec<Sample<1>> {
        let at = |i: usize| i as f64 * spacing;
        (0..count)
            .map(|i| Sample {
                at: at(i),
                value: [of(at(i))],
                weight: 1.0,
            })
            .collect()
    }

    #[test]
    fn low_frequencies_pass_and_high_ones_do_not() {
        let amplitude = |periods: f64| {
            let wave = |at: f64| (TAU * periods * at).sin();
            let curve = UniformSpline::fit(&samples(wave, 400, 0.25), 0.25, 0.5);
            (100..300)
                .map(|i| curve.value([f64::from(i) * 0.25][0])[0].abs())
                .fold(0.0, f64::max)
        };
        assert!(amplitude(0.2) > 0.99, "{}", amplitude(0.2));
        assert!((amplitude(0.5) - 0.5).abs() < 0.05, "{}", amplitude(0.5));
        assert!(amplitude(1.3) < 0.01, "{}", amplitude(1.3));
    }

    #[test]
    fn one_sample_or_none_gives_a_constant() {
        let one = UniformSpline::fit(&samples(|_| 7.0, 1, 1.0), 0.5, 1.0);
        assert!((one.value(-3.0)[0] - 7.0).abs() < 1e-6 && (one.value(9.0)[0] - 7.0).abs() < 1e-6);
        assert_eq!(
            UniformSpline::<2>::fit(&[], 1.0, 1.0).value(4.0),
            [0.0, 0.0]
        );
    }

    proptest! {
        /// The third derivative of a parabola is zero, so there is no penalty.
        #[test]
        fn parabolas_are_reproduced(a in -5.0..5.0f64, b in -5.0..5.0f64, c in -1.0..1.0f64, at in 0.0..9.0f64) {
            let of = |t: f64| a + t * (b + t * c);
            let curve: UniformSpline<1> = UniformSpline::fit(&samples(of, 40, 0.25), 0.3, 0.5);
            prop_assert!((curve.value(at)[0] - of(at)).abs() < 1e-4);
            prop_assert!((curve.slope(at)[0] - (b + 2.0 * c * at)).abs() < 1e-3);
        }
    }
}
