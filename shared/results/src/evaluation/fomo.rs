//! The errors of positions as fomo-sdk judges recordings of FoMo, in the plane.

use gyre_geometry::Pose;

use crate::evaluation::{MatchedPoses, SEGMENT_LENGTHS_M, ate::align_about};

/// Largest relative difference between a length and the path between the two poses of a pair.
const TOLERANCE: f64 = 0.1;

/// Errors after an alignment that takes the first position to the true one, and fits the rest of
/// the first quarter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fomo {
    /// Mean over the lengths of 100 to 800 m of the RMS difference between the estimated and the
    /// true displacement, % of the length.
    pub rpe_percent: f64,
    /// RMS distance of the positions, m.
    pub ape_rmse_m: f64,
}

/// Returns the errors; `None` where the path is shorter than 90 m.
///
/// Each pose is the start of a pair for each length, and its end is the pose that is nearest to the
/// length along the true path. The lengths end at the first without a pair. Headings are not used.
pub fn fomo(matched: &MatchedPoses) -> Option<Fomo> {
    let (estimate, truth) = (matched.estimate(), matched.truth());
    let quarter = matched.len() / 4;
    let [e0, t0] = [estimate, truth].map(|poses| poses[0].translation.vector);
    let truth_from_estimate = align_about(e0, t0, &estimate[..quarter], &truth[..quarter]);
    let error = |(e, t): (&Pose, &Pose)| {
        (truth_from_estimate * e).translation.vector - t.translation.vector
    };
    let errors: Vec<_> = matched.iter().map(error).collect();
    let distance_m = matched.distance_m();
    let percent = |length_m: f64| {
        let ends =
            (0..errors.len()).filter_map(|first| Some((first, end(&distance_m, first, length_m)?)));
        let squares = ends.map(|(first, end)| (errors[end] - errors[first]).norm_squared());
        Some(100.0 / length_m * root_mean(squares)?)
    };
    let percents: Vec<f64> = SEGMENT_LENGTHS_M.into_iter().map_while(percent).collect();
    percents.first()?;
    Some(Fomo {
        rpe_percent: percents.iter().sum::<f64>() / percents.len() as f64,
        ape_rmse_m: root_mean(errors.iter().map(|error| error.norm_squared()))?,
    })
}

/// Returns the pose whose distance from `first` along the path is nearest to a length.
fn end(distance_m: &[f64], first: usize, length_m: f64) -> Option<usize> {
    let to_m = distance_m[first] + length_m;
    let after = distance_m.partition_point(|at_m| *at_m < to_m);
    let off_m = |pose: usize| (distance_m[pose] - to_m).abs();
    let is_after = after < distance_m.len() && off_m(after) < off_m(after - 1);
    let nearest = if is_after { after } else { after - 1 };
    (off_m(nearest) <= TOLERANCE * length_m).then_some(nearest)
}

fn root_mean(squares: impl Iterator<Item = f64>) -> Option<f64> {
    let squares: Vec<f64> = squares.collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn one_false_position_counts_in_each_length_that_ends_there() {
        let frame = pose(40.0, -3.0, 2.5);
        let at = |k: u8, left_m: f64| pose(100.0 * f64::from(k), left_m, 0.3 * f64::from(k));
        let truth: Vec<Pose> = (0..8).map(|k| at(k, 0.0)).collect();
        let left_m = |k| if k == 7 { 8.0 } else { 0.0 };
        let estimate = (0..8).map(|k| frame * at(k, left_m(k))).collect();
        let errors = fomo(&MatchedPoses::new(estimate, truth)).unwrap();
        // Of 8 - k pairs of k hundred metres one ends there: the mean of 8 % / (k sqrt(8 - k)).
        assert!((errors.rpe_percent - 1.408_386_45).abs() < 1e-8);
        assert!((errors.ape_rmse_m - 8f64.sqrt()).abs() < 1e-9);
        let still = vec![pose(0.0, 0.0, 0.0); 8];
        assert_eq!(fomo(&MatchedPoses::new(still.clone(), still)), None);
    }
}
