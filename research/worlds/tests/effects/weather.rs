//! Rain, fog and snow.

use gyre_worlds::Effects;
use gyre_worlds::profile::Profile;
use gyre_worlds::weather::WeatherConfig;

use super::scene::{Setup, db, is_dark, mean_db, peak_db, post, power, powers};

const RAIN: WeatherConfig = WeatherConfig {
    from_s: 0.0,
    rain_mm_h: 100.0,
    fog_g_m3: 0.0,
    snow_mm_h: 0.0,
    blocked_db: 0.0,
};
const FOG: WeatherConfig = WeatherConfig {
    rain_mm_h: 0.0,
    fog_g_m3: 3.0,
    ..RAIN
};
const SNOW: WeatherConfig = WeatherConfig {
    rain_mm_h: 0.0,
    snow_mm_h: 40.0,
    ..RAIN
};
const ON: Effects = Effects {
    weather: true,
    ..Effects::NONE
};

/// Excess loss by the weather of an echo at 220 m over one at 20 m, dB.
fn loss_db(weather: WeatherConfig, effects: Effects) -> f64 {
    let loss = |range_m: f64, cross_section_m2: f64| {
        let at = |weather| {
            let setup = Setup {
                weather,
                ..Setup::of(vec![post(range_m, 100.0, cross_section_m2)], effects)
            };
            let setup = setup.with(Profile::Ras6);
            peak_db(&setup.scan(), 100, setup.bins(range_m - 1.0..range_m + 1.0))
        };
        at(WeatherConfig::default()) - at(weather)
    };
    loss(220.0, 1e4) - loss(20.0, 10.0)
}

#[test]
fn rain_attenuates_as_in_p_838() {
    // ITU-R P.838-3, horizontal polarisation, 76.5 GHz: between k 1.0315, alpha 0.7345 (70 GHz) and
    // 1.1704, 0.7115 (80 GHz).
    let db_km = 1.122 * 100f64.powf(0.7195);
    let loss = loss_db(RAIN, ON);
    assert!(
        (loss - 0.4 * db_km).abs() < 1.0,
        "{loss} dB for {} dB",
        0.4 * db_km
    );
    assert_eq!(loss_db(RAIN, Effects::NONE), 0.0);
}

#[test]
fn a_blocked_radome_makes_the_radar_blind() {
    let blocked = |blocked_db| {
        let weather = WeatherConfig {
            blocked_db,
            ..WeatherConfig::default()
        };
        let setup = Setup {
            weather,
            ..Setup::of(vec![post(50.0, 100.0, 30.0)], ON)
        };
        peak_db(&setup.scan(), 100, setup.bins(49.0..51.0))
    };
    let [clear, muddy, blind] = [0.0, 10.0, 100.0].map(blocked);
    assert!(
        (clear - muddy - 10.0).abs() < 1.0,
        "{clear} dB and {muddy} dB"
    );
    assert!(clear - blind > 30.0, "{clear} dB and {blind} dB");
}

#[test]
fn fog_attenuates_as_in_p_840() {
    // 4.6 dB/km for each g/m3 at 76.5 GHz and 10 degrees.
    let loss = loss_db(FOG, ON);
    assert!((loss - 0.4 * 4.6 * 3.0).abs() < 0.8, "{loss} dB");
    assert_eq!(loss_db(FOG, Effects::NONE), 0.0);
}

#[test]
fn rain_fills_the_beam_whose_area_grows_with_the_square_of_range() {
    let setup = Setup {
        weather: RAIN,
        effects: ON,
        ..Setup::default()
    };
    let scans = setup.scans(2);
    let clutter_m2 = |range_m: f64| {
        let received = mean_db(&scans, 0..400, setup.bins(range_m - 1.0..range_m + 1.0));
        let attenuation = 2.0 * range_m * RAIN.attenuation_db_m(76.5);
        received - db(setup.receiver().sensitivity(range_m)) + attenuation
    };
    let (near, far) = (clutter_m2(20.0), clutter_m2(80.0));
    assert!(
        (far - near - db(16.0)).abs() < 0.4,
        "{far} dB and {near} dB"
    );
    // So it falls with the square of range, not with the fourth power like a point's echo; here
    // less, since the receiver's gain rises.
    let setup = Setup {
        weather: RAIN,
        effects: Effects::NONE,
        ..Setup::default()
    };
    assert!(is_dark(&setup.scan()));
}

#[test]
fn snow_is_spottier_than_rain() {
    // Second moment of power over the square of its mean: 2 for Gaussian noise.
    let moment = |weather| {
        let setup = Setup {
            weather,
            effects: ON,
            ..Setup::default()
        };
        let scan = setup.scan();
        let near = setup.bins(19.0..21.0);
        let rows = powers(&scan);
        let values = rows
            .iter()
            .flat_map(|row| row[near.clone()].iter().map(|count| power(*count)));
        let (count, sum, squares) =
            values.fold((0.0, 0.0, 0.0), |(n, s, q), p| (n + 1.0, s + p, q + p * p));
        squares * count / (sum * sum)
    };
    let (rain, snow) = (moment(RAIN), moment(SNOW));
    assert!((rain - 2.0).abs() < 0.2, "{rain}");
    assert!((2.4..4.0).contains(&snow), "{snow}");
}
