//! Fluctuation of a single post's echo.

use gyre_geometry::{Twist, OwnedScan};
use gyre_worlds::body::{NO_BODY, Scatterer};
use nalgebra::Point2;

use super::scene::{Setup, only, peak_db};

/// Number of scans in one turn around the post.
const SCANS: u64 = 200;
const TURN_RADPS: f64 = std::f64::consts::TAU / (0.25 * SCANS as f64);

/// Scans of a post that stays 20 m to the left: the radar circles around it.
fn scans(count: u64, scintillation: bool, yaw_rate_radps: f64) -> Vec<OwnedScan> {
    let post = Scatterer::all_round(Point2::new(0.0, 20.0), 3.0, NO_BODY);
    let round = Twist {
        vx_mps: 20.0 * yaw_rate_radps,
        vy_mps: 0.0,
        yaw_rate_radps,
    };
    Setup {
        path: &round,
        ..Setup::of(vec![post], only(|e| &mut e.scintillation, scintillation))
    }
    .scans(count)
}

/// The post's power in each scan, dB.
fn powers_db(scans: &[OwnedScan]) -> Vec<f64> {
    scans
        .iter()
        .map(|scan| peak_db(scan, 299, Setup::default().bins(19.0..21.0)))
        .collect()
}

#[test]
#[ignore = ".ci/nightly: a distribution over many scans"]
fn power_is_exponentially_distributed_over_directions_about_the_constant_one() {
    let (steady, flickering) = (
        powers_db(&scans(SCANS, false, TURN_RADPS)),
        powers_db(&scans(SCANS, true, TURN_RADPS)),
    );
    let factors: Vec<f64> = steady
        .iter()
        .zip(&flickering)
        .map(|(steady, on)| 10f64.powf((on - steady) / 10.0))
        .collect();
    let mean = factors.iter().sum::<f64>() / factors.len() as f64;
    assert!((0.75..1.3).contains(&mean), "{mean}");
    // For an exponential distribution 1 - exp(-0.2) = 18% lies below a fifth of the mean, exp(-2) =
    // 14% above twice it.
    let share = |chosen: &dyn Fn(f64) -> bool| {
        factors.iter().filter(|f| chosen(**f)).count() as f64 / SCANS as f64
    };
    let (weak, strong) = (share(&|f| f < 0.2), share(&|f| f > 2.0));
    assert!(
        (weak - 0.18).abs() < 0.09 && (strong - 0.14).abs() < 0.09,
        "{weak} and {strong}"
    );
}

#[test]
fn power_changes_between_poses_and_not_at_rest_or_without_the_effect() {
    let largest_change_db = |powers: &[f64]| {
        powers
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .fold(0.0, f64::max)
    };
    assert!(largest_change_db(&powers_db(&scans(30, true, TURN_RADPS))) > 6.0);
    assert!(
        largest_change_db(&powers_db(&scans(30, false, TURN_RADPS))) <= 0.5,
        "one step of the quantisation"
    );
    assert_eq!(largest_change_db(&powers_db(&scans(30, true, 0.0))), 0.0);
}
