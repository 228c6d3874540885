//! Echoes of scatterers and walls: aspect, occlusion, images, interference.

use gyre_worlds::Effects;
use gyre_worlds::body::{Aspect, Wall};
use nalgebra::{Point2, Rotation2, Vector2};

use super::scene::{Setup, db, only, peak_db, post};

#[test]
fn two_scatterers_cancel_or_add_in_amplitude_with_speckle_and_in_power_without() {
    let wavelength_m = Setup::default().receiver().wavelength_m();
    let peak = |speckle, apart_m: f64| {
        let pair = vec![post(20.0, 100.0, 0.5), post(20.0 + apart_m, 100.0, 0.5)];
        let setup = Setup::of(pair, only(|e| &mut e.speckle, speckle));
        peak_db(&setup.scan(), 100, setup.bins(18.0..22.0)) - setup.received_db(0.5, 20.0)
    };
    // Two-way: a quarter of a wavelength of range is half a wavelength of path.
    assert!(
        peak(true, wavelength_m / 4.0) < -35.0,
        "{}",
        peak(true, wavelength_m / 4.0)
    );
    assert!(
        (peak(true, wavelength_m / 2.0) - 6.0).abs() < 0.7,
        "{}",
        peak(true, wavelength_m / 2.0)
    );
    for apart_m in [wavelength_m / 4.0, wavelength_m / 2.0] {
        assert!(
            (peak(false, apart_m) - 3.0).abs() < 0.6,
            "{}",
            peak(false, apart_m)
        );
    }
}

#[test]
fn a_panel_at_30_degrees_reflects_by_the_power_of_its_cosine_and_without_aspect_equally() {
    let peak = |aspect, turned_rad: f64| {
        let mut panel = post(30.0, 100.0, 20.0);
        let normal = Rotation2::new(turned_rad) * -panel.position.coords.normalize();
        panel.aspect = Aspect::Facing {
            normal,
            sharpness: 20.0,
        };
        let setup = Setup::of(vec![panel], only(|e| &mut e.aspect, aspect));
        peak_db(&setup.scan(), 100, setup.bins(29.0..31.0))
    };
    let fall_db = peak(true, 0.0) - peak(true, 30f64.to_radians());
    assert!(
        (fall_db + 20.0 * db(30f64.to_radians().cos())).abs() < 0.8,
        "{fall_db} dB"
    );
    assert_eq!(peak(false, 0.0), peak(false, 1.0));
    // The mean over all directions is the same with and without aspect.
    let mean = 1.0 / (std::f64::consts::TAU * 20.64).sqrt();
    assert!((peak(false, 0.0) - peak(true, 0.0) - db(mean)).abs() < 0.8);
}

#[test]
fn a_wall_attenuates_by_its_transmission() {
    let peak = |occlusion, transmission: Option<f64>| {
        let mut setup = Setup::of(
            vec![post(30.0, 100.0, 20.0)],
            only(|e| &mut e.occlusion, occlusion),
        );
        let across = |x| Point2::new(x, -20.0);
        let wall = |transmission| Wall::rough(across(-5.0), across(5.0), transmission, 1);
        setup.body.walls.extend(transmission.map(wall));
        peak_db(&setup.scan(), 100, setup.bins(29.0..31.0))
    };
    let open = peak(true, None);
    assert!(
        (open - peak(true, Some(1e-3)) - 30.0).abs() < 0.6,
        "{}",
        peak(true, Some(1e-3))
    );
    assert_eq!(open, peak(false, Some(1e-3)));
}

#[test]
fn a_mirrored_post_appears_at_its_image_with_the_squared_mirrored_share() {
    let mirror = Wall {
        from: Point2::new(-20.0, -10.0),
        to: Point2::new(20.0, -10.0),
        transmission: 1e-6,
        mirror: 0.8,
        body: 1,
    };
    // At the centre of azimuth 100, to the right.
    let image = post(16.0, 100.0, 4.0);
    let mut thing = image;
    thing.position.y = -20.0 - image.position.y;
    let peak = |multipath, scatterer, walls: Vec<Wall>| {
        let mut setup = Setup::of(
            vec![scatterer],
            Effects {
                multipath,
                occlusion: true,
                ..Effects::NONE
            },
        );
        setup.body.walls = walls;
        peak_db(&setup.scan(), 100, setup.bins(15.5..16.5))
    };
    let (ghost, alone) = (peak(true, thing, vec![mirror]), peak(true, image, vec![]));
    assert!(
        (ghost - alone - 2.0 * db(0.8)).abs() < 0.8,
        "{ghost} dB for {alone} dB"
    );
    assert!(peak(false, thing, vec![mirror]) < 1.0);
    assert!(
        peak(
            true,
            thing,
            vec![Wall {
                mirror: 0.1,
                ..mirror
            }]
        ) < 1.0,
        "a rough wall shows nothing"
    );
}

#[test]
fn a_ghost_is_invisible_where_the_line_of_sight_misses_the_mirror() {
    let short = Wall {
        from: Point2::new(5.0, -10.0),
        to: Point2::new(20.0, -10.0),
        transmission: 0.5,
        mirror: 0.8,
        body: 1,
    };
    let mut thing = post(16.0, 100.0, 30.0);
    thing.position += Vector2::new(0.0, 12.0);
    let mut setup = Setup::of(vec![thing], only(|e| &mut e.multipath, true));
    setup.body.walls = vec![short];
    assert!(peak_db(&setup.scan(), 100, setup.bins(15.5..16.5)) < 1.0);
}
