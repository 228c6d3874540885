//! Effects of a real road: hills, heights, foliage, bounces, vibration, dirt and calibration.

use gyre_geometry::OwnedScan;
use gyre_worlds::{body::Wall, profile::Profile, Effects, Realism, Relief, SimulationConfig, Simulator, write_dataset};
use nalgebra::Point2;

use super::scene::{Setup, db, mean_db, peak_bin, peak_db, post, power, powers};

/// Returns no effect but these.
fn with(change: impl FnOnce(&mut Effects)) -> Effects {
    let mut effects = Effects::NONE;
    change(&mut effects);
    effects
}

/// Faint posts at a range, one at the centre of every fourth azimuth.
fn faint_ring(range_m: f64) -> Vec<gyre_worlds::body::Scatterer> {
    (0..100)
        .map(|i| post(range_m, 4.0 * f64::from(i), 0.2))
        .collect()
}

#[test]
fn near_things_appear_too_far_by_their_height_on_the_slant_and_far_ones_do_not() {
    let mean_m = |slant, range_m| {
        let setup = Setup::of(faint_ring(range_m), with(|e| e.slant_range = Some(slant)));
        let scan = setup.scan();
        let bins = (0..100).map(|i| peak_bin(&scan, 4 * i));
        setup.sampling().range_m(bins.sum::<f64>() / 100.0)
    };
    // Heights are uniform up to 1.6 m: h^2/2r on average.
    let expected_m = |range_m: f64| 1.6f64.powi(2) / 3.0 / (2.0 * range_m);
    for range_m in [5.0, 40.0] {
        assert!((mean_m(false, range_m) - range_m).abs() < 0.03);
        let too_far_m = mean_m(true, range_m) - range_m;
        assert!(
            (too_far_m - expected_m(range_m)).abs() < 0.025,
            "{range_m} m: {too_far_m} for {}",
            expected_m(range_m)
        );
    }
}

/// Angle of a place above the plane of a vehicle that stands at the origin, radians.
fn off_plane_rad(relief: Relief, place: Point2<f64>) -> f64 {
    let (range_m, direction) = (place.coords.norm(), place.coords.normalize());
    relief.rise_m(Point2::origin(), place) / range_m - relief.slope_rad(Point2::origin(), direction)
}

/// Hills on which many of the places are within each of two ranges off the plane of a vehicle at
/// the origin.
fn hills(places: &[Point2<f64>], is_within: [fn(f64) -> bool; 2]) -> Relief {
    let fewest = |seed: &u64| {
        let off = |place: &&Point2<f64>| off_plane_rad(Relief::hills(*seed), **place);
        let count = |is: fn(f64) -> bool| places.iter().filter(|place| is(off(place))).count();
        is_within.map(count).into_iter().min()
    };
    Relief::hills((0..300).max_by_key(fewest).unwrap())
}

#[test]
fn what_lies_off_the_plane_of_the_vehicle_on_a_hill_leaves_the_beam() {
    let ring = faint_ring(60.0);
    let places: Vec<_> = ring.iter().map(|s| s.position).collect();
    let mut setup = Setup::of(ring, with(|e| e.elevation = true));
    setup.relief = hills(
        &places,
        [|off_rad| off_rad.abs() < 0.01, |off_rad| off_rad > 0.03],
    );
    let scan = setup.scan();
    let mean_db = |off_rad: std::ops::Range<f64>| {
        let there = |(i, place): (usize, &Point2<f64>)| {
            let is_there = off_rad.contains(&off_plane_rad(setup.relief, *place).abs());
            is_there.then(|| peak_db(&scan, 4 * i, setup.bins(58.0..62.0)))
        };
        let peaks: Vec<f64> = places.iter().enumerate().filter_map(there).collect();
        assert!(peaks.len() > 5, "{} posts off by {off_rad:?}", peaks.len());
        peaks.iter().sum::<f64>() / peaks.len() as f64
    };
    let (within, outside) = (mean_db(0.0..0.01), mean_db(0.03..1.0));
    assert!(within > outside + 4.0, "{within} dB and {outside} dB");
}

#[test]
fn the_ground_is_bright_where_it_rises_into_the_beam_and_dark_where_it_falls_away() {
    const RANGE_M: f64 = 30.0;
    let places: Vec<_> = (0..40)
        .map(|i| post(RANGE_M, 10.0 * f64::from(i), 1.0).position)
        .collect();
    let hills = hills(
        &places,
        [|off_rad| off_rad > 0.02, |off_rad| off_rad < -0.02],
    );
    let scans = |relief| {
        let mut setup = Setup::of(vec![], with(|e| e.ground = true)).with(Profile::Cts350xRadiate);
        setup.relief = relief;
        setup.scans(4)
    };
    let (hilly, level) = (scans(hills), scans(Relief::LEVEL));
    let bins = Setup::default()
        .with(Profile::Cts350xRadiate)
        .bins(28.0..32.0);
    let brighter_db = |off_rad: std::ops::Range<f64>| {
        let azimuths: Vec<usize> = (0..40)
            .filter(|i| off_rad.contains(&off_plane_rad(hills, places[*i])))
            .map(|i| 10 * i)
            .collect();
        assert!(
            azimuths.len() > 3,
            "{} places off by {off_rad:?}",
            azimuths.len()
        );
        let db = |scans| mean_db(scans, azimuths.iter().copied(), bins.clone());
        db(&hilly) - db(&level)
    };
    let (risen, fallen) = (brighter_db(0.02..1.0), brighter_db(-1.0..-0.02));
    assert!(risen > 4.0 && fallen < -1.0, "{risen} dB and {fallen} dB");
}

#[test]
fn leaves_echo_differently_in_each_scan_and_trunks_and_houses_do_not() {
    let scans = |sway, cross_section_m2, body| {
        let mut thing = post(20.0, 100.0, cross_section_m2);
        thing.body = body;
        let setup = Setup::of(vec![thing], with(|e| e.sway = Some(sway)));
        let scans = setup.scans(40);
        let peak = |scan: &OwnedScan| peak_db(scan, 100, setup.bins(18.0..22.0));
        scans.iter().map(peak).collect::<Vec<_>>()
    };
    let spread = |peaks: Vec<f64>| {
        let mean = peaks.iter().sum::<f64>() / peaks.len() as f64;
        (peaks.iter().map(|peak| (peak - mean).powi(2)).sum::<f64>() / peaks.len() as f64).sqrt()
    };
    assert!((1.0..3.0).contains(&spread(scans(true, 0.3, 0))));
    for still in [
        scans(false, 0.3, 0),
        scans(true, 3.0, 0),
        scans(true, 0.3, 9),
    ] {
        assert!(spread(still) < 1e-9);
    }
}

#[test]
fn a_bounce_appears_between_a_post_and_its_image_with_the_power_of_both_ways() {
    // A post 1.5 m before a wall, seen along it: its image is 5.1 degrees beside it.
    let (thing, image): (Point2<f64>, Point2<f64>) =
        (Point2::new(30.0, -8.5), Point2::new(30.0, -11.5));
    let bearing = |place: Point2<f64>| -place.y.atan2(place.x);
    let middle_rad = (bearing(thing) + bearing(image)) / 2.0;
    let range_m = (thing.coords.norm() + image.coords.norm()) / 2.0;
    let sampling = Setup::default().sampling();
    let azimuth = ((middle_rad - sampling.azimuth_rad(0)) / sampling.step_rad()).round();
    let peak = |one_bounce| {
        let mut scatterer = post(30.0, azimuth, 60.0);
        scatterer.position = thing;
        let mut setup = Setup::of(
            vec![scatterer],
            Effects {
                side_lobes: true,
                one_bounce: Some(one_bounce),
                ..Effects::NONE
            },
        );
        setup.body.walls = vec![Wall {
            from: Point2::new(5.0, -10.0),
            to: Point2::new(60.0, -10.0),
            transmission: 1e-6,
            mirror: 0.8,
            body: 1,
        }];
        let bins = setup.bins(range_m - 0.1..range_m + 0.1);
        peak_db(&setup.scan(), azimuth as usize, bins)
    };
    // Two-way side lobes at 2.3 half-power widths: -28 dB.
    let expected = Setup::default().received_db(60.0, range_m) + db(4.0) + db(0.8) - 28.2;
    assert!(
        (peak(true) - expected).abs() < 2.0,
        "{} dB for {expected}",
        peak(true)
    );
    assert!(peak(false) < expected - 5.0, "{}", peak(false));
}

#[test]
#[ignore = ".ci/nightly: a distribution over many scans"]
fn a_vibrating_mount_moves_bearings_by_a_fiftieth_of_a_degree() {
    let bearings = |vibration| {
        let setup = Setup::of(
            vec![post(20.0, 100.0, 3.0)],
            with(|e| e.vibration = Some(vibration)),
        );
        let centre = |scan: &OwnedScan| {
            let sum = |row: &[u8]| {
                row.iter()
                    .map(|count| power(*count) - power(0))
                    .sum::<f64>()
            };
            let sums: Vec<f64> = powers(scan).into_iter().map(sum).collect();
            let moment = sums.iter().enumerate().map(|(i, sum)| i as f64 * sum);
            0.9 * moment.sum::<f64>() / sums.iter().sum::<f64>()
        };
        setup.scans(60).iter().map(centre).collect::<Vec<_>>()
    };
    let spread = |values: Vec<f64>| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    assert!(spread(bearings(false)) < 1e-9);
    let swing_deg = spread(bearings(true));
    assert!((0.012..0.03).contains(&swing_deg), "{swing_deg} degrees");
}

#[test]
fn dirt_darkens_the_same_sectors_in_every_scan() {
    let posts: Vec<_> = (0..100)
        .map(|i| post(20.0, 4.0 * f64::from(i), 3.0))
        .collect();
    let loss_db = |dirt| {
        let setup = Setup::of(posts.clone(), with(|e| e.dirt = Some(dirt)));
        let scans = setup.scans(2);
        let peak = |scan: &OwnedScan, i: usize| peak_db(scan, 4 * i, setup.bins(19.0..21.0));
        let all = |scan| (0..100).map(|i| peak(scan, i)).collect::<Vec<_>>();
        assert_eq!(all(&scans[0]), all(&scans[1]));
        all(&scans[0])
    };
    let (clean, dirty) = (loss_db(false), loss_db(true));
    let losses: Vec<f64> = clean.iter().zip(&dirty).map(|(a, b)| a - b).collect();
    let worst = losses.iter().copied().fold(0.0, f64::max);
    let same = losses.iter().filter(|loss| **loss < 0.3).count();
    assert!(
        (1.0..14.0).contains(&worst) && same > 40,
        "{worst} dB, {same}"
    );
}

#[test]
fn a_radar_with_errors_shows_everything_as_far_off_in_each_scan_and_says_nothing() {
    let bins = |miscalibration, range_m| {
        let setup = Setup::of(
            vec![post(range_m, 100.0, 3.0)],
            with(|e| e.miscalibration = Some(miscalibration)),
        );
        let scans = setup.scans(2);
        assert_eq!(peak_bin(&scans[0], 100), peak_bin(&scans[1], 100));
        let told = scans[0].geometry;
        assert_eq!(told.range_offset_m, setup.sampling().range_offset_m as f32);
        peak_bin(&scans[0], 100) * setup.sampling().range_resolution_m
    };
    let error_m = |range_m| bins(true, range_m) - bins(false, range_m);
    let (near_m, far_m) = (error_m(20.0), error_m(60.0));
    assert!(near_m.abs() > 0.04 && near_m.abs() < 1.0, "{near_m} m");
    assert!((far_m - near_m).abs() > 0.04, "{near_m} m and {far_m} m");
}

#[test]
fn the_effects_of_a_road_change_no_random_number_of_the_noise() {
    let scan = |config: SimulationConfig| {
        let effects = config.resolved().effects;
        let nothing_to_see = Effects {
            noise: true,
            hills: effects.hills,
            slant_range: effects.slant_range,
            sway: effects.sway,
            one_bounce: effects.one_bounce,
            vibration: effects.vibration,
            dirt: effects.dirt,
            miscalibration: effects.miscalibration,
            ..Effects::NONE
        };
        Setup::of(vec![], nothing_to_see).scan().bytes
    };
    let road = SimulationConfig {
        realism: Realism::Road,
        ..SimulationConfig::default()
    };
    assert!(scan(SimulationConfig::default()) == scan(road));
}

#[test]
fn realism_decides_what_is_left_out_and_nothing_else() {
    let written = toml::to_string(&SimulationConfig::default()).unwrap();
    for key in ["realism", "belts", "hills", "slant_range", "lost_azimuths"] {
        assert!(!written.contains(key), "{key} in {written}");
    }
    let plain = SimulationConfig::default().resolved();
    assert!(plain.effects.hills == Some(false) && plain.town.belts == Some(0.0));
    let text = "realism = \"road\"\n[effects]\nhills = false\n[town]\nbelts = 0.1\n";
    let road: SimulationConfig = toml::from_str(text).unwrap();
    let resolved = road.resolved();
    assert_eq!(resolved.town.belts, Some(0.1));
    assert_eq!(resolved.effects.hills, Some(false));
    assert_eq!(resolved.effects.slant_range, Some(true));
    assert_eq!(
        resolved.effects.lost_azimuths,
        Some(false),
        "not in Oxford's format"
    );
    let radiate: SimulationConfig =
        toml::from_str(&format!("{text}[output]\nformat = \"radiate\"\n")).unwrap();
    assert_eq!(radiate.resolved().effects.lost_azimuths, Some(true));
}

#[test]
fn a_plain_simulation_is_the_same_with_all_of_the_road_switched_off() {
    let plain = SimulationConfig::default();
    let mut off = SimulationConfig {
        realism: Realism::Road,
        effects: plain.resolved().effects,
        ..plain.clone()
    };
    off.town.belts = Some(0.0);
    off.sensor.gain_db = Some(0.0);
    let scan = |config| Simulator::new(&config).unwrap().render_scan(3).scan.bytes;
    let road = SimulationConfig {
        realism: Realism::Road,
        ..plain.clone()
    };
    assert!(scan(plain.clone()) == scan(off));
    assert!(scan(plain) != scan(road));
}

#[test]
fn a_recording_that_names_what_is_left_out_today_is_continued() {
    let folder = tempfile::tempdir().unwrap();
    let config = |scans| SimulationConfig {
        scans: Some(scans),
        ..SimulationConfig::default()
    };
    write_dataset(&config(1), folder.path(), &mut |_, _| ()).unwrap();
    let made_by = folder.path().join("simulation.toml");
    let text = std::fs::read_to_string(&made_by).unwrap();
    let named = text.replace("[effects]", "[effects]\nlost_azimuths = false");
    assert!(named != text);
    std::fs::write(&made_by, named).unwrap();
    write_dataset(&config(2), folder.path(), &mut |_, _| ()).unwrap();
}
