use gyre_geometry::samples::{GyroConfig, Sample, SampleKind, UpAxis};
use proptest::prelude::*;

use super::*;
use crate::Estimate;
use std::path::Path;

const START_NS: i64 = 1_549_986_607_000_000_000;
const AXES: [UpAxis; 6] = [
    UpAxis::X,
    UpAxis::MinusX,
    UpAxis::Y,
    UpAxis::MinusY,
    UpAxis::Z,
    UpAxis::MinusZ,
];

/// A drive with its gyro.
#[derive(Clone, Debug)]
struct Simulated {
    up: UpAxis,
    delay_s: f64,
    scale: f64,
    bias_radps: f64,
    drift: f64,
    /// Seed of the turns and of the noise.
    seed: u64,
    duration_s: f64,
    /// Yaw rates up to this, rad/s.
    turning_radps: f64,
    heading_sigma_rad: f64,
    /// Time after which the turns repeat, s.
    repeats_s: Option<f64>,
}

impl Default for Simulated {
    fn default() -> Self {
        Self {
            up: UpAxis::MinusZ,
            delay_s: 1.58,
            scale: 1.01,
            bias_radps: 2e-3,
            drift: 0.0,
            seed: 1,
            duration_s: 120.0,
            turning_radps: 0.2,
            heading_sigma_rad: 1e-3,
            repeats_s: None,
        }
    }
}

fn noise(seed: u64, place: u64) -> f64 {
    let mut x =
        seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ place.wrapping_mul(0xD1B5_4A32_D192_ED03);
    for _ in 0..3 {
        x ^= x >> 31;
        x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    }
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl Simulated {
    /// The heading at a time: bends of some seconds, which never repeat.
    fn heading(&self, time_s: f64) -> f64 {
        let waves = (0..12).map(|k| {
            let rate = 0.25 + 0.11 * k as f64 + 0.05 * noise(self.seed, 100 + k);
            let rate = self.repeats_s.map_or(rate, |repeats_s| {
                std::f64::consts::TAU / repeats_s * (1 + k % 4) as f64
            });
            let phase = 3.0 * noise(self.seed, 200 + k);
            let part = self.turning_radps / 4.0 * noise(self.seed, 300 + k);
            part / rate * (rate * time_s + phase).sin()
        });
        waves.sum()
    }

    fn samples(&self) -> Vec<Sample> {
        let rate_hz = 20.0;
        let samples = (-200..(self.duration_s * rate_hz) as i64 + 200).map(|k| {
            let time_s = k as f64 / rate_hz + 0.013;
            let h = 1e-4;
            let rate = (self.heading(time_s + h) - self.heading(time_s - h)) / (2.0 * h);
            let place = (k + 1000) as u64;
            let measured = (rate + self.bias_radps) / self.scale;
            let others = [1, 2].map(|axis| 0.05 * noise(self.seed + axis, place));
            let mut values = [others[0], others[1], others[0], 0.0, 0.0, 0.0];
            let axis = match self.up {
                UpAxis::X | UpAxis::MinusX => 0,
                UpAxis::Y | UpAxis::MinusY => 1,
                UpAxis::Z | UpAxis::MinusZ => 2,
            };
            let sign = self.up.in_vehicle([1.0; 3])[2];
            values[axis] = sign * measured + 2e-3 * noise(self.seed + 9, place);
            let delay_s = self.delay_s + self.drift * (time_s - self.duration_s / 2.0);
            Sample {
                stamp_ns: START_NS + ((time_s + delay_s) * 1e9).round() as i64,
                kind: SampleKind::Gyro as u32,
                reserved: 0,
                values,
            }
        });
        samples.collect()
    }

    /// Stamps and headings of the scans.
    fn radar(&self) -> (Vec<i64>, Vec<f64>) {
        let scans = (self.duration_s * 4.0) as u64;
        let at = |k: u64| {
            let heading = self.heading(k as f64 * 0.25);
            heading + 1.7 * self.heading_sigma_rad * noise(self.seed + 5, 5000 + k)
        };
        let stamps = (0..scans).map(|k| START_NS + 250_000_000 * k as i64);
        (stamps.collect(), (0..scans).map(at).collect())
    }

    fn calibrated_by(&self, samples: &[Sample]) -> Result<GyroCalibration, ClockError> {
        let (stamps, headings) = self.radar();
        let starts = vec![false; stamps.len()];
        calibrate_turns(&stamps, &headings, &starts, samples, 0.12)
    }

    fn calibrated(&self) -> Result<GyroCalibration, ClockError> {
        self.calibrated_by(&self.samples())
    }
}

/// The usual drive with some differences.
fn simulated(change: impl FnOnce(&mut Simulated)) -> Simulated {
    let mut drive = Simulated::default();
    change(&mut drive);
    drive
}

fn assert_refused(found: Result<GyroCalibration, ClockError>, expected: &[&str]) {
    let reason = found.unwrap_err().to_string();
    assert!(expected.iter().any(|it| reason.contains(it)), "{reason}");
}

fn assert_within(found: Estimate, truth: f64, most_sigma: f64, what: &str) {
    let apart = (found.value - truth).abs();
    assert!(apart < 4.0 * found.sigma, "{what}: {found:?} for {truth}");
    assert!(found.sigma < most_sigma, "{what}: {found:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever the axis, the offset, the scale and the bias, they are found within their
    /// uncertainties, which are small.
    #[test]
    fn clock_axis_scale_and_bias_are_found(
        up in prop::sample::select(&AXES[..]), delay_s in -100.0..100.0f64, scale in 0.97..1.03f64,
        bias_radps in -0.01..0.01f64, seed in 1u64..1000,
    ) {
        let usual = Simulated::default();
        let drive = Simulated { up, delay_s, scale, bias_radps, seed, ..usual };
        let found = drive.calibrated().unwrap();
        prop_assert_eq!(found.up, up);
        assert_within(found.delay_s, delay_s, 0.02, "delay_s");
        assert_within(found.scale, scale, 0.01, "scale");
        assert_within(found.bias_radps, bias_radps, 1e-3, "bias");
        prop_assert!(!found.drifts(), "{:?}", found.drift);
    }
}

#[test]
fn a_clock_that_drifts_is_told() {
    let drive = simulated(|it| (it.drift, it.duration_s) = (5e-4, 300.0));
    let found = drive.calibrated().unwrap();
    assert_within(found.drift, 5e-4, 1e-4, "drift");
    assert!(found.drifts());
    let table = found.table(&GyroConfig::default());
    assert!(
        table.contains("one delay_s does not do for a long drive"),
        "{table}"
    );
}

#[test]
fn stalls_of_the_log_are_left_out_and_not_interpolated() {
    let drive = Simulated::default();
    let mut samples = drive.samples();
    let whole = drive.calibrated().unwrap();
    let at_s = |sample: &Sample| (sample.stamp_ns - START_NS) as f64 * 1e-9;
    samples.retain(|sample| {
        !(30.0..34.0).contains(&at_s(sample)) && !(60.0..60.8).contains(&at_s(sample))
    });
    let found = drive.calibrated_by(&samples).unwrap();
    assert!(
        found.turns < whole.turns - 20,
        "{} {}",
        found.turns,
        whole.turns
    );
    assert_within(found.delay_s, 1.58, 0.02, "delay_s");
    assert_within(found.scale, 1.01, 0.01, "scale");
}

#[test]
fn the_log_of_another_drive_is_refused() {
    for seed in 2..12 {
        let other = simulated(|it| it.seed = seed);
        let found = Simulated::default().calibrated_by(&other.samples());
        assert_refused(found, &["but about as well", "parts of the drive"]);
    }
    let later = simulated(|it| it.delay_s = 3600.0);
    let expected = "covers 0 turns of a second, and 36 are needed: it begins 3590 s after";
    assert_refused(later.calibrated(), &[expected]);
}

#[test]
fn a_straight_or_short_drive_is_refused() {
    for drive in [
        simulated(|it| it.turning_radps = 0.0),
        simulated(|it| (it.turning_radps, it.heading_sigma_rad) = (2e-3, 3e-3)),
        simulated(|it| it.duration_s = 8.0),
    ] {
        let expected = [
            "too straight or too short",
            "turns too little",
            "the drive is too short",
        ];
        assert_refused(drive.calibrated(), &expected);
    }
}

#[test]
fn a_drive_whose_turns_repeat_is_refused_whatever_the_offset() {
    for late_ms in [0, 70, 120, 700, 1580] {
        let delay_s = 1e-3 * f64::from(late_ms);
        let drive = simulated(|it| (it.delay_s, it.repeats_s) = (delay_s, Some(8.03)));
        assert_refused(drive.calibrated(), &["but about as well"]);
    }
}

#[test]
fn a_log_in_degrees_per_second_is_told() {
    let scale = 1f64.to_radians();
    let drive = simulated(|it| (it.scale, it.bias_radps, it.turning_radps) = (scale, 0.0, 0.05));
    assert_refused(drive.calibrated(), &["its rates are in deg/s"]);
}

#[test]
fn the_section_is_a_configuration_of_what_was_found() {
    let drive = Simulated::default();
    let found = drive.calibrated().unwrap();
    let table: toml::Table = found.toml(None).parse().unwrap();
    let config: GyroConfig = table["gyro"].clone().try_into().unwrap();
    assert_eq!(config.up, Some(UpAxis::MinusZ));
    assert!((config.delay_s - 1.58).abs() < 0.02 && (config.scale - 1.01).abs() < 0.01);
    assert!((config.bias_radps - 2e-3).abs() < 1e-3);
    assert_eq!(
        config.bias_sigma_radps,
        GyroConfig::default().bias_sigma_radps
    );
    config.validate().unwrap();
    let path = Path::new("/a \"log\"\\x.csv");
    let table: toml::Table = found.toml(Some(path)).parse().unwrap();
    let config: GyroConfig = table["gyro"].clone().try_into().unwrap();
    assert_eq!(config.file.as_deref(), Some(path));
    // Beside a configuration with another delay.
    let configured = GyroConfig {
        delay_s: 0.0,
        ..config
    };
    let table = found.table(&configured);
    assert!(
        table.contains("configured 0.0000: CONTRADICTS the configured value"),
        "{table}"
    );
}

#[test]
fn drives_of_one_gyro_are_combined_if_they_name_one_axis() {
    let found = |up, seed| simulated(|it| (it.up, it.seed) = (up, seed)).calibrated();
    let [one, two] = [1, 2].map(|seed| found(UpAxis::MinusZ, seed).unwrap());
    let mean = one.mean(std::slice::from_ref(&two)).unwrap();
    let most_sigma = one.delay_s.sigma.max(two.delay_s.sigma);
    assert_within(mean.delay_s, 1.58, most_sigma, "delay_s");
    assert_eq!(mean.turns, one.turns + two.turns);
    let other = found(UpAxis::Z, 2).unwrap();
    assert_refused(
        one.mean(&[other]),
        &["one drive has -z up, a different drive z"],
    );
}
