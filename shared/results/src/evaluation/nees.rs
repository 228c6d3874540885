//! Normalised estimation error squared (NEES): the consistency of covariances with the errors of
//! motions.
//!
//! Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001,
//! Sec. 5.4. The error of a segment of consecutive motions is e = (x, y, yaw) of the estimate less
//! the ground truth, along the axes of its first frame; P is the covariance composed over the
//! segment, plus the covariance of the ground truth. The NEES e' inv(P) e of a consistent
//! covariance has a chi-square distribution, whose expectation is its degrees of freedom: 3, or 2
//! for the translation alone, or 1 for the yaw. Segments of one length share no motion.

use std::num::NonZeroUsize;

use nalgebra::{Matrix2, Matrix3, Vector3};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::evaluation::{MatchedMotions, TruthSigma, motions::Chain};

#[derive(Debug, Clone, PartialEq)]
pub struct NeesOptions {
    pub lengths: Vec<NonZeroUsize>,
    /// The uncertainty of the ground truth, which is added to each covariance.
    pub truth_sigma: TruthSigma,
}

impl Default for NeesOptions {
    /// Returns 1, 4, 16 and 64 motions, and an exact ground truth.
    fn default() -> Self {
        let lengths = [1, 4, 16, 64].into_iter();
        Self {
            lengths: lengths.filter_map(NonZeroUsize::new).collect(),
            truth_sigma: TruthSigma::default(),
        }
    }
}

/// The NEES of the motions for each segment length. `Display` is a table; `{:#}` adds both halves
/// of the drive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Nees {
    pub motions: usize,
    /// Motions left out because an end has no ground truth.
    pub without_truth: usize,
    /// Motions left out because they have no positive definite covariance.
    pub without_covariance: usize,
    pub truth_sigma: TruthSigma,
    /// The figures for each length that has segments, in the order given.
    pub by_length: Vec<NeesLength>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeesLength {
    pub motions: usize,
    pub all: NeesFigures,
    /// Segments that start in the first half of the drive's duration.
    pub first_half: Option<NeesFigures>,
    pub second_half: Option<NeesFigures>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeesFigures {
    pub segments: usize,
    pub pose: NeesFigure,
    pub translation: NeesFigure,
    pub yaw: NeesFigure,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NeesFigure {
    /// The mean NEES divided by its degrees of freedom. Above 1 the covariances are overconfident,
    /// below 1 conservative.
    pub ratio: f64,
    /// The interval with 95 % of the ratios of consistent covariances, if errors are Gaussian and
    /// independent.
    pub acceptance_interval: [f64; 2],
    /// Share of the segments whose error lies outside the 95 % region of their covariance, %.
    pub outside_percent: f64,
}

/// The probability of a region, and of the acceptance interval.
const CONFIDENCE: f64 = 0.95;

/// Degrees of freedom of pose, translation and yaw.
const FREEDOMS: [usize; 3] = [3, 2, 1];

/// Returns the NEES of the motions.
///
/// The noise of the ground truth dominates short segments unless `truth_sigma` accounts for it;
/// long segments are few.
pub fn nees(matched: &MatchedMotions, options: &NeesOptions) -> Nees {
    let (from_ns, to_ns) = matched.span_ns();
    let middle_ns = from_ns.midpoint(to_ns);
    let of_length = |&length: &NonZeroUsize| {
        let of_chain = |chain| segments(chain, length, options.truth_sigma);
        let samples: Vec<_> = matched.chains.iter().flat_map(of_chain).collect();
        let middle = samples.partition_point(|sample| sample.from_ns < middle_ns);
        let (first, second) = samples.split_at(middle);
        Some(NeesLength {
            motions: length.get(),
            all: figures(&samples)?,
            first_half: figures(first),
            second_half: figures(second),
        })
    };
    Nees {
        motions: matched.motions,
        without_truth: matched.without_truth,
        without_covariance: matched.without_covariance,
        truth_sigma: options.truth_sigma,
        by_length: options.lengths.iter().filter_map(of_length).collect(),
    }
}

#[derive(Debug, Clone, Copy)]
struct Sample {
    from_ns: i64,
    squared: [f64; 3],
}

/// Returns the consecutive segments of `length` motions that have ground truth at both ends.
fn segments(
    chain: &Chain,
    length: NonZeroUsize,
    sigma: TruthSigma,
) -> impl Iterator<Item = Sample> + '_ {
    let length = length.get();
    let starts = (0..chain.motions.len())
        .step_by(length)
        .filter(move |first| chain.motions.len() - first >= length);
    starts.filter_map(move |first| {
        let truth = chain.true_motion(first, first + length)?;
        let segment = chain.composed(first).nth(length - 1)?;
        let covariance = segment.covariance + sigma.of_motion(&truth);
        let squared = normalised(&segment.error(&truth), &covariance)?;
        Some(Sample {
            from_ns: chain.stamps_ns[first],
            squared,
        })
    })
}

/// Returns the NEES of pose, translation and yaw; `None` if P is not positive definite.
fn normalised(error: &Vector3<f64>, covariance: &Matrix3<f64>) -> Option<[f64; 3]> {
    let pose = error.dot(&covariance.cholesky()?.solve(error));
    let position: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0).into_owned();
    let translation = error.xy().dot(&position.cholesky()?.solve(&error.xy()));
    Some([pose, translation, error.z * error.z / covariance[(2, 2)]])
}

fn figures(samples: &[Sample]) -> Option<NeesFigures> {
    let of = |part: usize| {
        let (n, freedom) = (samples.len(), FREEDOMS[part]);
        let values = || samples.iter().map(|sample| sample.squared[part]);
        let limit = chi_square_quantile(CONFIDENCE, freedom);
        let expected = (n * freedom) as f64;
        let tail = 0.5 * (1.0 - CONFIDENCE);
        NeesFigure {
            ratio: values().sum::<f64>() / expected,
            acceptance_interval: [tail, 1.0 - tail]
                .map(|p| chi_square_quantile(p, n * freedom) / expected),
            outside_percent: 100.0 * values().filter(|&value| value > limit).count() as f64
                / n as f64,
        }
    };
    (!samples.is_empty()).then(|| NeesFigures {
        segments: samples.len(),
        pose: of(0),
        translation: of(1),
        yaw: of(2),
    })
}

fn chi_square_quantile(p: f64, freedom: usize) -> f64 {
    ChiSquared::new(freedom as f64).map_or(f64::NAN, |chi_square| chi_square.inverse_cdf(p))
}
