//! The response of a point: beam, side lobes, elevation, range window.

use gyre_worlds::Effects;
use gyre_worlds::profile::Profile;

use super::scene::{Setup, db, mean_db, only, peak_db, post, power};

#[test]
fn without_effects_only_the_points_response_remains() {
    let setup = Setup::of(vec![post(20.0, 100.0, 3.0)], Effects::NONE);
    let scan = setup.scan();
    let (azimuths, bins) = (97..=103, setup.bins(18.9..21.1));
    for azimuth in 0..400 {
        for (bin, count) in scan.view().row(azimuth).iter().enumerate() {
            let inside = azimuths.contains(&azimuth) && bins.contains(&bin);
            assert!(
                *count == 0 || inside,
                "azimuth {azimuth}, bin {bin}: {count}"
            );
        }
    }
    let (top, wanted) = (peak_db(&scan, 100, bins), setup.received_db(3.0, 20.0));
    // 6e5 of a full scale of 1e7 is compressed by a quarter of a decibel.
    assert!(
        (top - wanted + 0.25).abs() < 0.4,
        "{top} dB for {wanted} dB"
    );
}

#[test]
fn a_point_falls_by_6_db_at_one_resolution_cell() {
    for profile in [Profile::Cts350xOxford, Profile::Cir204h, Profile::Ras6] {
        let setup = Setup::of(vec![post(20.0, 100.0, 0.1)], Effects::NONE).with(profile);
        let (sampling, cell_m) = (setup.sampling(), setup.receiver().cell_m);
        let range_m = sampling.range_m(sampling.bin(20.0).round());
        let setup = Setup::of(vec![post(range_m, 100.0, 0.1)], Effects::NONE).with(profile);
        let scan = setup.scan();
        let at = |range_m: f64| {
            db(power(
                scan.view().row(100)[sampling.bin(range_m).round() as usize],
            ))
        };
        for side_m in [-cell_m, cell_m] {
            let fall_db = at(range_m) - at(range_m + side_m);
            assert!(
                (fall_db - 6.0).abs() < 1.6,
                "{profile:?}, {side_m} m: {fall_db} dB"
            );
        }
    }
}

#[test]
fn side_lobes_decrease_and_vanish_without_the_effect() {
    let measured = |side_lobes| {
        let setup = Setup::of(
            vec![post(40.0, 100.0, 200.0)],
            only(|e| &mut e.side_lobes, side_lobes),
        );
        let (scan, bins) = (setup.scan(), setup.bins(39.0..41.0));
        [97, 95, 93, 103, 105, 107]
            .map(|azimuth| setup.received_db(200.0, 40.0) - peak_db(&scan, azimuth, bins.clone()))
    };
    let down_db = measured(true);
    assert_eq!(down_db[..3], down_db[3..], "both sides are alike");
    assert!(
        down_db[0] + 5.0 < down_db[1] && down_db[1] + 3.0 < down_db[2],
        "{down_db:?}"
    );
    assert!((35.0..50.0).contains(&down_db[1]), "{down_db:?}");
    assert!(
        measured(false).iter().all(|down_db| *down_db > 58.0),
        "{:?}",
        measured(false)
    );
}

#[test]
fn a_flat_beam_misses_most_faint_near_scatterers_and_few_strong_ones() {
    let measured = |cross_section_m2, elevation| {
        let posts = (0..400)
            .step_by(5)
            .map(|azimuth| post(10.0, azimuth as f64, cross_section_m2))
            .collect();
        let setup = Setup::of(posts, only(|e| &mut e.elevation, elevation));
        let at = setup.sampling().bin(10.0).round() as usize;
        let scans = setup.scans(8);
        let changed = (0..400).step_by(5).filter(|azimuth| {
            let counts = scans.iter().map(|scan| scan.view().row(*azimuth)[at]);
            counts.clone().max() != counts.min()
        });
        (
            mean_db(&scans, (0..400).step_by(5), at..at + 1),
            changed.count(),
        )
    };
    let (plane, faint) = (measured(0.05, false), measured(0.05, true));
    assert!(
        (3.0..12.0).contains(&(plane.0 - faint.0)),
        "{plane:?} and {faint:?}"
    );
    assert_eq!(plane.1, 0, "nothing changes from scan to scan");
    assert!(faint.1 > 25, "many posts come and go: {}", faint.1);
    let strong_db = measured(5.0, false).0 - measured(5.0, true).0;
    assert!(
        strong_db < plane.0 - faint.0 - 2.0,
        "what stands upright is lit at some height: {strong_db} dB"
    );
}
