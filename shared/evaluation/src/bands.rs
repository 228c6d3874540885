//! The error of composed poses over time, beside the spread that their covariance promises.

use nalgebra::Vector3;

use crate::{MatchedMotions, TruthSigma, motions::Chain};

/// Errors and spreads along each unbroken chain of motions that has truth. A chain is aligned with the truth at its first
/// pose that has any: there both error and spread are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Bands {
    /// Sample after sample, the aligned pose first.
    pub chains: Vec<Vec<BandSample>>,
    /// What the spreads hold of the truth's own uncertainty.
    pub truth_sigma: TruthSigma,
}

/// One pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandSample {
    /// Time since the first motion began, s.
    pub time_s: f64,
    /// Estimate less truth of (x, y, yaw), along the axes of the aligned pose; m, rad in (-pi, pi].
    pub error: Vector3<f64>,
    /// Standard deviations of (x, y, yaw), the truth's own included; m, rad.
    pub sigma: Vector3<f64>,
}

/// Composes the motions of each chain, and holds every pose that has truth against it (Checchin et al., Fig. 3).
pub fn bands(judged: &MatchedMotions, truth_sigma: TruthSigma) -> Bands {
    let start_ns = judged.span_ns().0;
    let chains = judged
        .chains
        .iter()
        .map(|chain| samples(chain, start_ns, truth_sigma));
    Bands {
        chains: chains.filter(|samples| samples.len() > 1).collect(),
        truth_sigma,
    }
}

fn samples(chain: &Chain, start_ns: i64, truth_sigma: TruthSigma) -> Vec<BandSample> {
    let Some(first) = chain.truth.iter().position(Option::is_some) else {
        return Vec::new();
    };
    let time_s = |joint: usize| chain.stamps_ns[joint].abs_diff(start_ns) as f64 * 1e-9;
    let aligned = BandSample {
        time_s: time_s(first),
        error: Vector3::zeros(),
        sigma: Vector3::zeros(),
    };
    let later = chain
        .composed(first)
        .zip(first + 1..)
        .filter_map(|(pose, joint)| {
            let truth = chain.true_motion(first, joint)?;
            let covariance = pose.covariance + truth_sigma.of_motion(&truth);
            let sigma = covariance.diagonal().map(f64::sqrt);
            Some(BandSample {
                time_s: time_s(joint),
                error: pose.error(&truth),
                sigma,
            })
        });
    std::iter::once(aligned).chain(later).collect()
}

impl Bands {
    /// Share of the poses, aligned ones aside, whose error is within `sigmas` standard deviations: of x, y, yaw, %.
    pub fn inside_percent(&self, sigmas: f64) -> [f64; 3] {
        let later = || self.chains.iter().flat_map(|chain| chain.iter().skip(1));
        let inside = |part: usize| {
            later()
                .filter(|s| s.error[part].abs() <= sigmas * s.sigma[part])
                .count()
        };
        [0, 1, 2].map(|part| 100.0 * inside(part) as f64 / later().count().max(1) as f64)
    }
}
