//! The error of composed poses over time, with the standard deviation that their covariance states.

use gyre_geometry::UncertainMotion;
use nalgebra::Vector3;

use crate::evaluation::{MatchedMotions, TruthSigma, motions::Chain};

/// Errors and standard deviations along each unbroken chain of motions that has ground truth
/// (Checchin et al., Fig. 3).
///
/// A chain is aligned with the ground truth at its first pose that has any: there both are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Bands {
    /// The samples of each chain in order, the aligned pose first.
    pub chains: Vec<Vec<BandSample>>,
    /// The uncertainty of the ground truth that the standard deviations include.
    pub truth_sigma: TruthSigma,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandSample {
    /// Time since the first motion began, s.
    pub time_s: f64,
    /// (x, y, yaw) of the estimate less (x, y, yaw) of the ground truth, along the axes of the
    /// aligned pose; m, rad in (-pi, pi].
    pub error: Vector3<f64>,
    /// Standard deviations of (x, y, yaw), including the uncertainty of the ground truth; m, rad.
    pub sigma: Vector3<f64>,
}

/// Composes the motions of each chain and compares every pose with its ground truth, where there is
/// one.
pub fn bands(matched: &MatchedMotions, truth_sigma: TruthSigma) -> Bands {
    let start_ns = matched.span_ns().0;
    let of_chain = |chain| samples(chain, start_ns, truth_sigma);
    let chains = matched.chains.iter().map(of_chain);
    Bands {
        chains: chains.filter(|samples| samples.len() > 1).collect(),
        truth_sigma,
    }
}

fn samples(chain: &Chain, start_ns: i64, truth_sigma: TruthSigma) -> Vec<BandSample> {
    let Some(first) = chain.truth.iter().position(Option::is_some) else {
        return Vec::new();
    };
    let time_s = |node: usize| chain.stamps_ns[node].abs_diff(start_ns) as f64 * 1e-9;
    let aligned = BandSample {
        time_s: time_s(first),
        error: Vector3::zeros(),
        sigma: Vector3::zeros(),
    };
    let sample = |(pose, node): (UncertainMotion, usize)| {
        let truth = chain.true_motion(first, node)?;
        let covariance = pose.covariance + truth_sigma.of_motion(&truth);
        Some(BandSample {
            time_s: time_s(node),
            error: pose.error(&truth),
            sigma: covariance.diagonal().map(f64::sqrt),
        })
    };
    let later = chain.composed(first).zip(first + 1..).filter_map(sample);
    std::iter::once(aligned).chain(later).collect()
}

impl Bands {
    /// Returns the share of the poses whose error in x, y, yaw is within `sigmas` standard
    /// deviations, %. The aligned poses do not count.
    pub fn inside_percent(&self, sigmas: f64) -> [f64; 3] {
        let later = || self.chains.iter().flat_map(|chain| chain.iter().skip(1));
        let inside = |part: usize| {
            let is_inside = |s: &&BandSample| s.error[part].abs() <= sigmas * s.sigma[part];
            later().filter(is_inside).count()
        };
        [0, 1, 2].map(|part| 100.0 * inside(part) as f64 / later().count().max(1) as f64)
    }
}
