//! The kinds of noise, by their mean power.

use gyre_geometry::Twist;
use gyre_worlds::profile::Profile;

use super::scene::{Setup, is_dark, mean_db, only, post, powers};

const EVERYWHERE: std::ops::Range<usize> = 0..400;

#[test]
fn noise_has_the_profiles_floor_and_exponential_power() {
    let setup = Setup::of(vec![], only(|e| &mut e.noise, true));
    let setup = setup.with(Profile::Cts350xRadiate);
    let scans = setup.scans(2);
    let bins = setup.bins(40.0..60.0);
    let mean = mean_db(&scans, EVERYWHERE, bins.clone());
    // Tabulated: 10.0 dB at 5 m, 9.6 dB at 100 m.
    assert!((mean - 9.8).abs() < 0.3, "{mean} dB");
    let below = |share_db: f64| {
        let rows = scans
            .iter()
            .flat_map(|scan| powers(scan))
            .map(|row| &row[bins.clone()]);
        let counts: Vec<u8> = rows.flatten().copied().collect();
        let limit = 2.0 * (9.8 + share_db);
        counts
            .iter()
            .filter(|count| f64::from(**count) < limit)
            .count() as f64
            / counts.len() as f64
    };
    // For an exponential distribution 1 - 1/e lies below the mean, 1 - exp(-0.2) below a fifth of
    // it.
    assert!((below(0.0) - 0.632).abs() < 0.03, "{}", below(0.0));
    assert!((below(-7.0) - 0.181).abs() < 0.03, "{}", below(-7.0));
}

#[test]
fn whole_powers_leave_gaps_in_the_counts() {
    let found = |profile| {
        let setup = Setup::of(vec![], only(|e| &mut e.noise, true)).with(profile);
        let scan = setup.scan();
        let mut found = [false; 256];
        powers(&scan)
            .into_iter()
            .flatten()
            .for_each(|count| found[usize::from(*count)] = true);
        found
    };
    let (whole, fine) = (
        found(Profile::Cts350xOxford),
        found(Profile::Cts350xRadiate),
    );
    // Powers 1, 2, 3, 4, 5, 6.
    for count in 0..16 {
        assert_eq!(
            whole[count],
            [0, 6, 9, 12, 14, 15].contains(&count),
            "{count}"
        );
        assert!(fine[count], "{count}");
    }
}

#[test]
fn phase_noise_is_60_db_below_the_echo_in_far_bins_of_its_azimuth() {
    let measured = |phase_noise| {
        let setup = Setup::of(
            vec![post(30.0, 100.0, 2e4)],
            only(|e| &mut e.phase_noise, phase_noise),
        );
        let (scans, far) = (setup.scans(4), setup.bins(100.0..160.0));
        let below =
            |azimuth| setup.received_db(2e4, 30.0) - mean_db(&scans, [azimuth], far.clone());
        [below(100), below(101), below(110)]
    };
    let [there, beside, elsewhere] = measured(true);
    assert!((there - 60.0).abs() < 5.0, "{there} dB");
    // Off the beam's axis it falls as the echo does: 3 dB at half the beam's width, with the square
    // of the angle.
    let sensor = Setup::default();
    let fall_db = 12.04 * (sensor.sampling().step_rad() / sensor.receiver().beam_rad).powi(2);
    assert!(
        (beside - there - fall_db).abs() < 1.2,
        "{beside} dB and {there} dB, {fall_db} dB apart"
    );
    assert!(elsewhere > 80.0 && measured(false)[0] > 80.0);
}

#[test]
fn reverberation_follows_strong_echoes_and_never_precedes_them() {
    let azimuths = || (3..400).step_by(7);
    let setup = |reverberation| {
        let posts = azimuths()
            .map(|azimuth| post(31.0, azimuth as f64, 2e4))
            .collect();
        Setup::of(posts, only(|e| &mut e.reverberation, reverberation))
    };
    let on = setup(true);
    let scans = on.scans(4);
    for row in scans.iter().flat_map(|scan| powers(scan)) {
        assert!(row[on.bins(5.0..27.0)].iter().all(|count| *count == 0));
    }
    // Power below the echo by the distance behind it: in the directions with the most, the median
    // and the least reverberation of ten.
    let below_db = |behind_m: f64| {
        let rows = scans
            .iter()
            .flat_map(|scan| azimuths().map(move |azimuth| (scan, azimuth)));
        let bins = on.bins(30.2 + behind_m..31.8 + behind_m);
        let mut tails: Vec<f64> = rows
            .map(|(scan, azimuth)| mean_db(std::slice::from_ref(scan), [azimuth], bins.clone()))
            .collect();
        tails.sort_by(f64::total_cmp);
        [9, 5, 1].map(|tenths| on.received_db(2e4, 31.0) - tails[tails.len() * tenths / 10])
    };
    let [near, middle, far] = [6.0, 20.0, 60.0].map(below_db);
    assert!(
        near[1] + 2.0 < middle[1] && middle[1] + 2.0 < far[1],
        "{near:?}, {middle:?}, {far:?} dB"
    );
    assert!((45.0..65.0).contains(&middle[1]), "{middle:?} dB");
    assert!(
        middle[2] - middle[0] > 10.0,
        "directions differ: {middle:?} dB"
    );
    let off = setup(false).scan();
    assert!(
        powers(&off)
            .iter()
            .all(|row| row[on.bins(35.0..160.0)].iter().all(|count| *count == 0))
    );
}

#[test]
fn ringing_fills_the_first_metres_with_the_same_bytes_in_every_scan() {
    let setup = |ringing| Setup::of(vec![], only(|e| &mut e.ringing, ringing));
    let scans = setup(true).scans(2);
    assert_eq!(powers(&scans[0]), powers(&scans[1]));
    let (range_resolution_m, tabulated) = (
        setup(true).sampling().range_resolution_m,
        setup(true).receiver().ringing_db,
    );
    for (range_m, tabulated_db) in tabulated.iter().filter(|(_, db)| *db > 15.0) {
        let bin = (range_m / range_resolution_m) as usize;
        let level = mean_db(&scans[..1], EVERYWHERE, bin.saturating_sub(2)..bin + 3);
        // Neighbouring azimuths are correlated, so a sweep has only some ten independent values.
        assert!(
            (level - tabulated_db).abs() < 4.5,
            "{level} dB for {tabulated_db} dB at {range_m} m"
        );
    }
    assert!(
        powers(&scans[0])
            .iter()
            .all(|row| row[90..].iter().all(|count| *count == 0))
    );
    assert!(is_dark(&setup(false).scan()));
}

#[test]
fn ringing_changes_smoothly_between_azimuths_and_across_the_seam() {
    let scan = Setup::of(vec![], only(|e| &mut e.ringing, true)).scan();
    let rows = powers(&scan);
    // Differences between azimuths by their distance, dB, averaged over all bins up to 1.3 m.
    let apart_db = |azimuth: usize, apart: usize| {
        let (one, other) = (&rows[azimuth][..30], &rows[(azimuth + apart) % 400][..30]);
        let counts = one
            .iter()
            .zip(other)
            .map(|(a, b)| f64::from(a.abs_diff(*b)));
        counts.sum::<f64>() / 60.0
    };
    let mean = |apart| {
        (0..400)
            .map(|azimuth| apart_db(azimuth, apart))
            .sum::<f64>()
            / 400.0
    };
    assert!(
        2.0 * mean(1) < mean(100),
        "{} dB and {} dB",
        mean(1),
        mean(100)
    );
    assert!(
        apart_db(399, 1) < 0.8 * mean(100),
        "{} dB",
        apart_db(399, 1)
    );
}

#[test]
fn the_own_vehicle_is_behind_the_radar_at_any_heading() {
    let setup = |own_vehicle| Setup::of(vec![], only(|e| &mut e.own_vehicle, own_vehicle));
    let turning = Twist {
        vx_mps: 5.0,
        vy_mps: 0.0,
        yaw_rate_radps: 1.0,
    };
    let scans = Setup {
        path: &turning,
        ..setup(true)
    }
    .scans(4);
    let parked = setup(true).scan();
    assert!(scans.iter().all(|scan| powers(scan) == powers(&parked)));
    let near = setup(true).bins(0.5..8.0);
    for (azimuth, row) in powers(&parked).into_iter().enumerate() {
        // 0.7 rad to either side of straight behind, plus the beam.
        let behind = (150..=250).contains(&azimuth);
        assert!(
            row.iter()
                .enumerate()
                .all(|(bin, count)| *count == 0 || behind && near.contains(&bin))
        );
    }
    let parts = powers(&parked)
        .into_iter()
        .filter(|row| row.iter().any(|count| *count > 25))
        .count();
    assert!(parts > 10, "{parts} azimuths");
    assert!(is_dark(&setup(false).scan()));
}

#[test]
fn spurious_lines_are_at_their_ranges_with_or_without_noise() {
    let setup = Setup::of(vec![], only(|e| &mut e.spurious_lines, true));
    let setup = setup.with(Profile::Cts350xRadiate);
    let scans = setup.scans(4);
    let lit: Vec<usize> = (0..576)
        .filter(|bin| mean_db(&scans, EVERYWHERE, *bin..*bin + 1) > 3.0)
        .collect();
    let lines = lit.chunk_by(|a, b| b - a == 1).count();
    assert_eq!(lines, 4, "{lit:?}");
    // At 37% of 100 m: 0.9 of the floor, 9.9 dB, of which two thirds are in the line's own bin.
    let line = (200..226)
        .map(|bin| mean_db(&scans, EVERYWHERE, bin..bin + 1))
        .fold(0.0, f64::max);
    assert!((line - 7.6).abs() < 0.8, "{line} dB");
}
