//! Specular highlights of smooth walls.

use std::f64::consts::PI;

use gyre_geometry::{Twist, OwnedScan};
use gyre_worlds::{body::Wall, Body, Effects};
use nalgebra::{Point2, Vector2};

use super::scene::{Setup, db, is_dark, peak_bin, peak_db, post};

/// The azimuth to the right of Oxford's radar.
const RIGHT: usize = 100;

fn setup(highlights: bool, wall: Wall) -> Setup<'static> {
    let body = Body {
        scatterers: vec![],
        walls: vec![wall],
    };
    Setup {
        body,
        effects: Effects {
            highlights,
            sweep_motion: true,
            ..Effects::NONE
        },
        ..Setup::default()
    }
}

/// A mirror to the right, with ends `ahead_m` from the foot of the perpendicular.
fn mirror(range_m: f64, mirror: f64, ahead_m: std::ops::Range<f64>) -> Wall {
    let foot = post(range_m, RIGHT as f64, 1.0).position;
    let along = Vector2::new(-foot.y, foot.x).normalize();
    let (from, to) = (foot + along * ahead_m.start, foot + along * ahead_m.end);
    Wall {
        from,
        to,
        transmission: 1e-4,
        mirror,
        body: 1,
    }
}

#[test]
fn the_brightest_place_is_the_foot_of_the_perpendicular_at_any_time() {
    let (range_m, speed_mps) = (12.0, 8.0);
    let ahead = Twist {
        vx_mps: speed_mps,
        vy_mps: 0.0,
        yaw_rate_radps: 0.0,
    };
    let beside = Wall {
        from: Point2::new(-40.0, -range_m),
        to: Point2::new(40.0, -range_m),
        ..mirror(range_m, 0.5, 0.0..1.0)
    };
    let on = Setup {
        path: &ahead,
        ..setup(true, beside)
    };
    let scans = on.scans(9);
    let brightest = |scan: &OwnedScan| {
        let top = |azimuth: &usize| scan.view().row(*azimuth).iter().copied().max();
        let azimuth = (0..400).max_by_key(top).unwrap();
        let at_m = on.sampling().range_m(peak_bin(scan, azimuth));
        let angle = -on.sampling().azimuth_rad(azimuth);
        (at_m * angle.cos(), at_m * angle.sin(), azimuth)
    };
    for (index, scan) in [(0, &scans[0]), (8, &scans[8])] {
        // The sensor's place at that azimuth; the scans are 16 m apart.
        let (forward, left, azimuth) = brightest(scan);
        assert!(
            forward.abs() < 0.2 && (left + range_m).abs() < 0.1,
            "scan {index}: {forward} m, {left} m"
        );
        assert!(
            azimuth.abs_diff(RIGHT) <= 1,
            "scan {index}: azimuth {azimuth}"
        );
    }
    assert!(is_dark(
        &Setup {
            path: &ahead,
            ..setup(false, beside)
        }
        .scan()
    ));
    // Beyond its end the wall has no highlight.
    assert!(is_dark(on.scans(24).last().unwrap()));
}

#[test]
fn its_cross_section_is_that_of_the_mirror_image_less_a_constant_share() {
    let share_db = |range_m: f64, share: f64| {
        let setup = setup(true, mirror(range_m, share, -30.0..30.0));
        let peak = peak_db(
            &setup.scan(),
            RIGHT,
            setup.bins(range_m - 1.0..range_m + 1.0),
        );
        peak - setup.received_db(PI * range_m * range_m * share, range_m)
    };
    let shares = [(10.0, 0.8), (10.0, 0.2), (40.0, 0.8), (40.0, 0.2)]
        .map(|(range_m, share)| share_db(range_m, share));
    assert!(
        shares.iter().all(|db| (db - shares[0]).abs() < 0.8),
        "{shares:?} dB"
    );
    assert!((-40.0..db(0.5)).contains(&shares[0]), "{shares:?} dB");
    assert!(
        is_dark(&setup(true, mirror(10.0, 0.0, -30.0..30.0)).scan()),
        "a rough wall"
    );
    assert!(
        is_dark(&setup(true, mirror(10.0, 0.8, 1.0..30.0)).scan()),
        "a wall beside the perpendicular"
    );
}

#[test]
fn objects_in_front_hide_it() {
    let peak = |occlusion| {
        let mut setup = setup(true, mirror(20.0, 0.1, -30.0..30.0));
        setup.effects.occlusion = occlusion;
        setup.body.walls.push(Wall {
            transmission: 0.01,
            body: 2,
            ..mirror(10.0, 0.0, -5.0..5.0)
        });
        peak_db(&setup.scan(), RIGHT, setup.bins(19.0..21.0))
    };
    assert!(
        (peak(false) - peak(true) - 20.0).abs() < 0.8,
        "{} and {} dB",
        peak(false),
        peak(true)
    );
}
