use std::{f64::consts::TAU, path::Path};

use gyre_geometry::samples::{GyroConfig, SampleKind, SensorConfig as _, UpAxis, WheelsConfig};
use proptest::prelude::*;

use super::{
    kinds::{GYRO, WHEELS},
    *,
};
use crate::Estimate;

const START_NS: i64 = 1_549_986_607_000_000_000;
const SECOND_NS: f64 = 1e9;
const KINDS: [&Kind; 2] = [&GYRO, &WHEELS];
const AXES: [UpAxis; 6] = [
    UpAxis::X,
    UpAxis::MinusX,
    UpAxis::Y,
    UpAxis::MinusY,
    UpAxis::Z,
    UpAxis::MinusZ,
];

/// A drive with its sensor.
#[derive(Clone, Debug)]
struct Simulated {
    kind: &'static Kind,
    up: UpAxis,
    delay_s: f64,
    scale: f64,
    bias: f64,
    drift: f64,
    /// Seed of the motion and of the noise.
    seed: u64,
    duration_s: f64,
    /// Change of the rate up to this: rad/s, or tenths of m/s.
    varying: f64,
    radar_sigma: f64,
    /// Time after which the motion repeats, s.
    repeats_s: Option<f64>,
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
    /// The usual drive with some differences.
    fn new(kind: &'static Kind, change: impl FnOnce(&mut Self)) -> Self {
        let mut drive = Self {
            kind,
            up: UpAxis::MinusZ,
            delay_s: 1.58,
            scale: 1.01,
            bias: if kind.has_bias { 2e-3 } else { 0.0 },
            drift: 0.0,
            seed: 1,
            duration_s: 120.0,
            varying: 0.2,
            radar_sigma: 1e-3,
            repeats_s: None,
        };
        change(&mut drive);
        drive
    }

    fn is_gyro(&self) -> bool {
        self.kind.sensor == SampleKind::Gyro
    }

    /// The unit of the noise and of the variations: of wheels they are ten times as large, and they
    /// drive ahead meanwhile.
    fn unit(&self) -> f64 {
        if self.is_gyro() { 1.0 } else { 10.0 }
    }

    /// The heading or the distance at a time: bends of some seconds, which never repeat.
    fn amount(&self, time_s: f64) -> f64 {
        let waves = (0..12).map(|k| {
            let rate = 0.25 + 0.11 * k as f64 + 0.05 * noise(self.seed, 100 + k);
            let repeated = |repeats_s| TAU / repeats_s * (1 + k % 4) as f64;
            let rate = self.repeats_s.map_or(rate, repeated);
            let phase = 3.0 * noise(self.seed, 200 + k);
            let part = self.varying / 4.0 * noise(self.seed, 300 + k);
            part / rate * (rate * time_s + phase).sin()
        });
        let ahead = if self.is_gyro() { 0.0 } else { 8.0 * time_s };
        ahead + self.unit() * waves.sum::<f64>()
    }

    fn samples(&self) -> Vec<Sample> {
        let rate_hz = 20.0;
        let samples = (-200..(self.duration_s * rate_hz) as i64 + 200).map(|k| {
            let time_s = k as f64 / rate_hz + 0.013;
            let h = 1e-4;
            let rate = (self.amount(time_s + h) - self.amount(time_s - h)) / (2.0 * h);
            let place = (k + 1000) as u64;
            let jitter = self.unit() * 2e-3 * noise(self.seed + 9, place);
            let measured = (rate + self.bias) / self.scale;
            let delay_s = self.delay_s + self.drift * (time_s - self.duration_s / 2.0);
            let stamp_ns = START_NS + ((time_s + delay_s) * SECOND_NS).round() as i64;
            if !self.is_gyro() {
                return Sample::speed(stamp_ns, measured + jitter);
            }
            let others = [1, 2].map(|axis| 0.05 * noise(self.seed + axis, place));
            let mut sample = Sample::yaw_rate(stamp_ns, others[0]);
            sample.values[..2].copy_from_slice(&others);
            let axis = match self.up {
                UpAxis::X | UpAxis::MinusX => 0,
                UpAxis::Y | UpAxis::MinusY => 1,
                UpAxis::Z | UpAxis::MinusZ => 2,
            };
            let sign = self.up.in_vehicle([1.0; 3])[2];
            sample.values[axis] = sign * measured + jitter;
            sample
        });
        samples.collect()
    }

    fn calibrated_by(&self, samples: &[Sample]) -> Result<SensorCalibration, ClockError> {
        let at = |k: u64| {
            let sigma = self.unit() * self.radar_sigma;
            self.amount(k as f64 * 0.25) + 1.7 * sigma * noise(self.seed + 5, 5000 + k)
        };
        let step = |k: u64| {
            let amount = k.checked_sub(1).map(|before| at(k) - at(before));
            (START_NS + 250_000_000 * k as i64, amount)
        };
        let steps: Vec<Step> = (0..(self.duration_s * 4.0) as u64).map(step).collect();
        calibrate_steps(self.kind, &steps, samples, 0.12)
    }

    fn calibrated(&self) -> Result<SensorCalibration, ClockError> {
        self.calibrated_by(&self.samples())
    }
}

fn assert_refused(found: Result<SensorCalibration, ClockError>, expected: &[&str]) {
    let reason = found.unwrap_err().to_string();
    assert!(expected.iter().any(|it| reason.contains(it)), "{reason}");
}

fn assert_within(found: Estimate, truth: f64, most_sigma: f64, what: &str) {
    let apart = (found.value - truth).abs();
    assert!(apart <= 4.0 * found.sigma, "{what}: {found:?} for {truth}");
    assert!(found.sigma < most_sigma, "{what}: {found:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the axis, the offset, the scale and the bias, they are found within their
    /// uncertainties, which are small.
    #[test]
    fn clock_axis_scale_and_bias_are_found(
        kind in prop::sample::select(&KINDS[..]), up in prop::sample::select(&AXES[..]),
        delay_s in -100.0..100.0f64, scale in 0.96..1.04f64, bias in -0.01..0.01f64,
        seed in 1u64..1000,
    ) {
        let bias = if kind.has_bias { bias } else { 0.0 };
        let usual = Simulated::new(kind, |_| ());
        let found = Simulated { up, delay_s, scale, bias, seed, ..usual }.calibrated().unwrap();
        prop_assert_eq!(found.up, (kind.axes > 1).then_some(up));
        assert_within(found.delay_s, delay_s, 0.02, "delay_s");
        assert_within(found.scale, scale, 0.01, "scale");
        assert_within(found.bias, bias, 1e-3, "bias");
        prop_assert!(!found.drifts(), "{:?}", found.drift);
    }
}

#[test]
fn a_clock_that_drifts_is_told() {
    let drive = Simulated::new(&GYRO, |it| (it.drift, it.duration_s) = (5e-4, 300.0));
    let found = drive.calibrated().unwrap();
    assert_within(found.drift, 5e-4, 1e-4, "drift");
    assert!(found.drifts());
    let table = found.table(&SensorSettings::default());
    let expected = "one delay_s does not do for a long drive";
    assert!(table.contains(expected), "{table}");
}

#[test]
fn stalls_of_the_log_are_left_out_and_not_interpolated() {
    for kind in KINDS {
        let drive = Simulated::new(kind, |_| ());
        let mut samples = drive.samples();
        let whole = drive.calibrated().unwrap();
        samples.retain(|sample| {
            let at_s = (sample.stamp_ns - START_NS) as f64 / SECOND_NS;
            !(30.0..34.0).contains(&at_s) && !(60.0..60.8).contains(&at_s)
        });
        let found = drive.calibrated_by(&samples).unwrap();
        let counts = [found.count, whole.count];
        assert!(counts[0] < counts[1] - 20, "{counts:?}");
        assert_within(found.delay_s, 1.58, 0.02, "delay_s");
        assert_within(found.scale, 1.01, 0.01, "scale");
    }
}

#[test]
fn drives_that_do_not_determine_the_clock_are_refused() {
    let unsteady = ["but about as well", "parts of the drive"];
    let few = [
        "turns too little",
        "changes too little",
        "too straight or too short",
        "the drive is too short",
    ];
    for kind in KINDS {
        let of = |change: fn(&mut Simulated)| Simulated::new(kind, change);
        for seed in 2..12 {
            let other = Simulated::new(kind, |it| it.seed = seed);
            assert_refused(of(|_| ()).calibrated_by(&other.samples()), &unsteady);
        }
        for late_ms in [0, 70, 120, 700, 1580] {
            let delay_s = 1e-3 * f64::from(late_ms);
            let change = |it: &mut Simulated| (it.delay_s, it.repeats_s) = (delay_s, Some(8.03));
            assert_refused(Simulated::new(kind, change).calibrated(), &unsteady[..1]);
        }
        for steady in [
            of(|it| it.varying = 0.0),
            of(|it| (it.varying, it.radar_sigma) = (0.0, 0.0)),
            of(|it| (it.varying, it.radar_sigma) = (2e-3, 3e-3)),
            of(|it| it.duration_s = 8.0),
        ] {
            assert_refused(steady.calibrated(), &few);
        }
    }
}

#[test]
fn another_day_and_another_unit_are_told() {
    let begins = "covers 0 turns of a second, and 36 are needed: it begins 3590 s after";
    let covers = "covers 0 distances of a second, and 36 are needed: the drive is too short";
    for (kind, day) in [(&GYRO, begins), (&WHEELS, covers)] {
        let later = Simulated::new(kind, |it| it.delay_s = 3600.0);
        assert_refused(later.calibrated(), &[day]);
    }
    let in_degrees = "its rates are in deg/s";
    let in_km_h = "the radar drives 0.278 times as far";
    for (kind, scale, varying, unit) in [
        (&GYRO, 1f64.to_radians(), 0.05, in_degrees),
        (&WHEELS, 1.0 / 3.6, 0.2, in_km_h),
    ] {
        let change = |it: &mut Simulated| (it.scale, it.bias, it.varying) = (scale, 0.0, varying);
        assert_refused(Simulated::new(kind, change).calibrated(), &[unit]);
    }
}

#[test]
fn the_section_is_a_configuration_of_what_was_found() {
    let path = Path::new("/a \"log\"\\x.csv");
    for kind in KINDS {
        let found = Simulated::new(kind, |_| ()).calibrated().unwrap();
        let section = |text: String| {
            let table: toml::Table = text.parse().unwrap();
            table[kind.sensor.section()].clone()
        };
        let table = section(found.toml(None, (!kind.has_bias).then_some(0.02)));
        let [delay_s, scale] = ["delay_s", "scale"].map(|key| table[key].as_float().unwrap());
        assert!((delay_s - 1.58).abs() < 0.02 && (scale - 1.01).abs() < 0.01);
        if kind.has_bias {
            let config: GyroConfig = table.try_into().unwrap();
            assert!((config.bias_radps - 2e-3).abs() < 1e-3);
            let usual = GyroConfig::default().bias_sigma_radps;
            assert_eq!((config.up, config.bias_sigma_radps), (found.up, usual));
            config.validate().unwrap();
        } else {
            let config: WheelsConfig = table.try_into().unwrap();
            assert_eq!(config.m_per_tick, Some(0.02));
            config.validate().unwrap();
        }
        let named = section(found.toml(Some(path), None));
        assert_eq!(named["file"].as_str(), path.to_str());
        // Beside a configuration with another delay.
        let configured = SensorSettings {
            is_used: true,
            scale,
            ..SensorSettings::default()
        };
        let table = found.table(&configured);
        let expected = "configured 0.0000: CONTRADICTS the configured value";
        assert!(table.contains(expected), "{table}");
    }
}

#[test]
fn drives_of_one_sensor_are_combined_if_they_name_one_axis() {
    for kind in KINDS {
        let found =
            |up, seed| Simulated::new(kind, |it| (it.up, it.seed) = (up, seed)).calibrated();
        let [one, two] = [1, 2].map(|seed| found(UpAxis::MinusZ, seed).unwrap());
        let mean = one.mean(std::slice::from_ref(&two)).unwrap();
        let most_sigma = one.delay_s.sigma.max(two.delay_s.sigma);
        assert_within(mean.delay_s, 1.58, most_sigma, "delay_s");
        assert_eq!(mean.count, one.count + two.count);
        if kind.axes > 1 {
            let expected = ["one drive has -z up, a different drive z"];
            assert_refused(one.mean(&[found(UpAxis::Z, 2).unwrap()]), &expected);
        }
    }
}

/// The delay and the scale in a run of a sensor whose measurements are so late and scaled, beside a radar with
/// noise, over 40 s with these rates.
fn compared(rate: fn(f64) -> f64, delay_s: f64, scale: f64) -> Option<[Estimate; 2]> {
    let over = |s: f64| {
        let parts = (0..25).map(|k| 0.01 * rate(s - 0.01 * f64::from(k)));
        parts.sum::<f64>()
    };
    let motion = |k: i32| {
        let by_radar = over(0.25 * f64::from(k)) + 2e-3 * (2.4 * f64::from(k)).sin();
        Compared {
            stamp_ns: i64::from(k) * 250_000_000,
            interval_ns: 250_000_000,
            radar: (k % 40 != 0).then_some(by_radar),
            other: Some(scale * over(0.25 * f64::from(k) - delay_s)),
        }
    };
    compare(&(0..160).map(motion).collect::<Vec<_>>(), true)
}

#[test]
fn a_delay_in_a_run_is_measured_and_none_is_made_up() {
    let winding = |s: f64| 0.055 * (0.314 * s).cos();
    let town = |s: f64| 0.2 * (0.4 * s).sin().powi(9) + 0.1 * (0.23 * s + 1.0).sin().powi(5);
    for (delay_s, scale) in [(-2.0, 1.0), (0.0, 0.8), (0.3, 1.3), (1.6, 1.0)] {
        for rate in [winding, town] {
            let [delay, of_scale] = compared(rate, delay_s, scale).unwrap();
            assert_within(delay, delay_s, 0.07, "delay_s");
            assert_within(of_scale, 1.0 / scale, 0.03, "scale");
        }
    }
    assert_eq!(compared(|_| 0.0, 1.0, 1.0), None, "a straight road");
    assert_eq!(compared(town, 0.0, -1.0), None, "another axis");
}
