//! `gyre evaluate RUN` without a ground truth: compares a run with itself and with the sensors
//! beside the radar.

use std::{path::Path, process::ExitCode};

use gyre_calibration::{Found, Reversal, calibrate_sensor};
use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_datasets::{
    InspectedLogs, LostAzimuthOption, ground_truth::read_trajectory, inspect_dataset,
};
use gyre_geometry::{
    Pose, pose,
    samples::{GnssConfig, GnssFix, SensorKind},
};
use gyre_radar::Trajectory;
use gyre_results::{SUMMARY, judgement, require_results};
use gyre_storage as storage;
use serde_json::Value;

use crate::calibrate::{CalibrateArguments, Recorded, Sensor};

/// Largest share of motions that the radar did not measure.
const UNMEASURED: f64 = 0.1;
/// Largest differences between the drive and the same drive backwards: of the length, and of the
/// turn, degrees/100 m.
const REVERSED_LENGTH: f64 = 0.005;
const REVERSED_DEG: f64 = 0.5;
/// Largest error at loops: of the position as a share of the path, and of the heading,
/// degrees/100 m.
const LOOP_SHARE: f64 = 0.005;
const LOOP_DEG: f64 = 0.2;
/// Steps of half a decibel of `masking.threshold` above the median power.
const ABOVE_NOISE: std::ops::RangeInclusive<i64> = 28..=54;
/// Largest difference of the lengths by the radar and by GNSS, over stretches of [`STRETCH_M`].
const SCALE: f64 = 0.01;
const STRETCH_M: f64 = 20.0;
const MIN_STRETCHES: usize = 10;
const GNSS: &str = "gnss";
/// Wheels are less certain: tyres wear.
const WHEELS_SCALE: f64 = 0.05;

struct Check {
    name: &'static str,
    figure: String,
    /// `None`: the drive does not determine it.
    passes: Option<bool>,
}

impl Check {
    fn new(name: &'static str, passes: Option<bool>, figure: String) -> Self {
        Self {
            name,
            figure,
            passes,
        }
    }

    fn is_missing(name: &'static str, figure: &str) -> Self {
        Self::new(name, None, figure.to_owned())
    }
}

/// Prints the checks of a run and the verdict. The exit code is 1 if a check fails.
pub fn judge(run: &Path) -> Result<ExitCode, Failure> {
    let checks = checks(run)?;
    for Check {
        name,
        figure,
        passes,
    } in &checks
    {
        let word = match passes {
            Some(true) => "good",
            Some(false) => "BAD",
            None => "unknown",
        };
        print::line(format_args!("{name:<15} {word:<8} {figure}"))?;
    }
    let named = |passes: Option<bool>| -> Vec<_> {
        let checks = checks.iter().filter(|check| check.passes == passes);
        checks.map(|check| check.name).collect()
    };
    let (bad, unknown) = (named(Some(false)), named(None));
    let mut verdict = match bad.is_empty() {
        true => "good".to_owned(),
        false => format!("BAD: {}", bad.join(", ")),
    };
    if !unknown.is_empty() {
        verdict += &format!("; not determined: {}", unknown.join(", "));
    }
    print::line(format_args!("{:<15} {verdict}", "verdict"))?;
    Ok(ExitCode::from(u8::from(!bad.is_empty())))
}

fn checks(run: &Path) -> Result<Vec<Check>, Failure> {
    require_results(run)?;
    let configuration = Configuration::read(&run.join("config.toml"), &[])?;
    if configuration.is_radar() {
        let run = run.display();
        return Err(format!(
            "the run in {run} has no ground truth, and the scans of its radar are not stored: name a ground truth, gyre evaluate {run} FILE, or record a run (record.file) and evaluate a run of that recording"
        )
        .into());
    }
    let summary = read_summary(&run.join(SUMMARY))?;
    let arguments = CalibrateArguments::of_run(run);
    let recorded = Recorded::read(configuration.clone(), &arguments)?;
    let mut checks = vec![ending(&summary), motions(&summary)];
    checks.extend(of_scans(&configuration, &summary)?);
    let sensors = of_sensors(&recorded);
    let reversed = reversed(&recorded.reversal);
    checks.push(match recorded.study() {
        Ok(study) => constants(&study.found),
        Err(error) => Check::is_missing("constants", &error.to_string()),
    });
    checks.extend([reversed, loops(&summary), gnss(&configuration, run)?]);
    checks.extend(sensors);
    Ok(checks)
}

fn read_summary(path: &Path) -> Result<Value, Failure> {
    let failed = |reason: String| format!("cannot read {}: {reason}", path.display());
    let text = storage::read_text(path, storage::SETTINGS);
    let text = text.map_err(|error| failed(error.to_string()))?;
    Ok(serde_json::from_str(&text).map_err(|error| failed(error.to_string()))?)
}

fn ending(summary: &Value) -> Check {
    let ending = summary["ending"].as_str().unwrap_or("failed");
    Check::new("ending", Some(ending == "complete"), ending.to_owned())
}

fn motions(summary: &Value) -> Check {
    let count = |name: &str| summary["motions"][name].as_f64().unwrap_or_default();
    let [refined, doubtful] = ["refined", "doubtful"].map(count);
    let all = refined + doubtful;
    Check::new(
        "motions",
        (all > 0.0).then_some(doubtful <= UNMEASURED * all),
        format!(
            "{doubtful} of {all} are weak or predicted; at most {:.0} %",
            100.0 * UNMEASURED
        ),
    )
}

/// The power above the noise, and azimuths that the host has lost.
fn of_scans(configuration: &Configuration, summary: &Value) -> Result<Vec<Check>, Failure> {
    if configuration.simulation.is_some() {
        return Ok(Vec::new());
    }
    let (path, options) = (&configuration.source.data, &configuration.dataset);
    let noise = i64::from(gyre_configuration::noise_floor(path, options)?);
    let threshold = i64::from(configuration.odometry.masking.floor());
    let above = threshold - noise;
    let lost = match options.lost_azimuths {
        Some(LostAzimuthOption::Ignore) => {
            let mut read = *options;
            read.lost_azimuths = None;
            let dataset = gyre_recording::open(path, &read)?;
            let report = inspect_dataset(path, dataset, &read, &InspectedLogs::default());
            let lacking = report.figures["rows"]["stale_scans"].as_u64().unwrap_or(0);
            let figure = format!("{lacking} scans lack azimuths, which the run ignored");
            Check::new("lost azimuths", Some(lacking == 0), figure)
        }
        _ => {
            let repaired = summary["lost"]["scans"].as_u64().unwrap_or(0);
            let figure = format!("repaired in {repaired} scans");
            Check::new("lost azimuths", Some(true), figure)
        }
    };
    Ok(vec![
        Check::new(
            "threshold",
            Some(ABOVE_NOISE.contains(&above)),
            format!(
                "{threshold}: {above} steps above the median power; {} to {}",
                ABOVE_NOISE.start(),
                ABOVE_NOISE.end()
            ),
        ),
        lost,
    ])
}

/// The constants by the parts of the scans.
fn constants(found: &Found) -> Check {
    let constants: Vec<_> = found.constants().collect();
    let figure = constants.join(&format!("\n{:<25}", ""));
    Check::new("constants", found.agrees(), figure)
}

/// The drive backwards.
fn reversed(reversal: &Reversal) -> Check {
    let length = reversal.length;
    let turn_deg = 100.0 * reversal.turn_rad_per_m.to_degrees();
    let agrees = length.abs() <= REVERSED_LENGTH && turn_deg.abs() <= REVERSED_DEG;
    Check::new(
        "reversed",
        Some(agrees),
        format!(
            "length {:.2} %, heading {turn_deg:.2} deg/100 m different; at most {} % and {REVERSED_DEG}",
            100.0 * length,
            100.0 * REVERSED_LENGTH
        ),
    )
}

fn loops(summary: &Value) -> Check {
    let at_loops = &summary["slam"]["odometry"];
    let of = |name: &str| at_loops[name].as_f64().unwrap_or_default();
    let (Some(loops), Some(path_m)) = (at_loops["loops"].as_u64(), summary["path_m"].as_f64())
    else {
        return Check::is_missing(
            "loops",
            "run with slam.kind = \"graph\", on a drive that sees a place again",
        );
    };
    let (share, deg) = (
        of("translation_rmse_m") / path_m,
        of("rotation_rmse_deg") / (0.01 * path_m),
    );
    Check::new(
        "loops",
        Some(share <= LOOP_SHARE && deg <= LOOP_DEG),
        format!(
            "odometry errs by {:.2} m, {:.2} deg at {loops} loops; at most {:.2} m, {:.2} deg",
            of("translation_rmse_m"),
            of("rotation_rmse_deg"),
            LOOP_SHARE * path_m,
            LOOP_DEG * 0.01 * path_m
        ),
    )
}

/// The scale and the sense of the trajectory by the fixes beside the scans, which the run may not
/// have used.
fn gnss(configuration: &Configuration, run: &Path) -> Result<Check, Failure> {
    let beside = GnssConfig {
        kind: SensorKind::Auto,
        ..configuration.gnss.clone()
    };
    let fixes = match gyre_recording::gnss_log(&beside, &configuration.source.data, run) {
        Ok(log) => log.map_or(Vec::new(), |log| log.on_radar(&beside)),
        Err(error) => {
            let figure = format!("scale and sense of the turns are not checked: {error}");
            return Ok(Check::is_missing(GNSS, &figure));
        }
    };
    let place = |fix: &GnssFix| pose(fix.east_m, fix.north_m, 0.0);
    let stamps = fixes.iter().map(|fix| fix.stamp_ns);
    let fixes = Trajectory::timed(stamps.collect(), fixes.iter().map(place).collect());
    let estimate = read_trajectory(&run.join("trajectory.tum"))?;
    Ok(against(&estimate, fixes))
}

/// Compares a trajectory with fixes.
fn against(estimate: &Trajectory, mut fixes: Trajectory) -> Check {
    // Its clock may differ: where the speeds determine by how much, that is taken out.
    let _ = judgement::take_time_offset_out(estimate, &mut fixes);
    let Ok(evaluation) = judgement::judge(estimate, &fixes) else {
        return Check::is_missing(GNSS, "the fixes are of different times");
    };
    let (by_radar, by_gnss) = stretches(estimate, &fixes);
    if by_gnss.len() < MIN_STRETCHES {
        return Check::is_missing(GNSS, "the fixes cover too little of the drive");
    }
    let ratio = by_radar.iter().sum::<f64>() / by_gnss.iter().sum::<f64>();
    let is_mirrored = evaluation.axes.y_negated;
    let sense = if is_mirrored { "; MIRRORED" } else { "" };
    Check::new(
        GNSS,
        Some((ratio - 1.0).abs() <= SCALE && !is_mirrored),
        format!(
            "the path is {ratio:.4} of that by GNSS{sense}, ATE {:.2} m; 1 +- {SCALE}",
            evaluation.ate.rmse_m
        ),
    )
}

/// Returns the distances between the ends of stretches of the path, by both.
fn stretches(estimate: &Trajectory, fixes: &Trajectory) -> (Vec<f64>, Vec<f64>) {
    let apart_m = |from: &Pose, to: &Pose| (to.translation.vector - from.translation.vector).norm();
    let (mut by_radar, mut by_fixes) = (Vec::new(), Vec::new());
    let mut from: Option<(Pose, Pose)> = None;
    for (stamp_ns, here) in estimate.stamps().iter().zip(&estimate.poses) {
        let Some(fix) = fixes
            .near(*stamp_ns, 500_000_000)
            .and_then(|_| fixes.at(*stamp_ns))
        else {
            from = None;
            continue;
        };
        let (pose, first) = from.get_or_insert((*here, fix));
        let length_m = apart_m(pose, here);
        if length_m >= STRETCH_M {
            by_radar.push(length_m);
            by_fixes.push(apart_m(first, &fix));
            from = Some((*here, fix));
        }
    }
    (by_radar, by_fixes)
}

/// The other sensors beside the scans: the axis of a gyro, and the scale of the wheels.
fn of_sensors(recorded: &Recorded) -> Vec<Check> {
    let sensors = recorded.sensors.iter().flatten();
    sensors.map(|sensor| of_sensor(recorded, sensor)).collect()
}

fn of_sensor(recorded: &Recorded, sensor: &Sensor) -> Check {
    let (kind, log) = (sensor.kind, &sensor.log);
    let name = kind.sensor.section();
    let (drive, track, max_gap_s) = (
        &recorded.drive,
        &recorded.track,
        sensor.configured.max_gap_s,
    );
    let found = match calibrate_sensor(kind, drive, track, &log.samples, max_gap_s) {
        Ok(found) => found,
        Err(error) => return Check::is_missing(name, &error.to_string()),
    };
    let scale = found.scale.value;
    let measured = format!("correlation {:.4}, scale {scale:.4}", found.correlation);
    let Some(up) = found.up else {
        let passes = (scale - 1.0).abs() <= WHEELS_SCALE;
        return Check::new(
            name,
            Some(passes),
            format!("{measured}; 1 +- {WHEELS_SCALE}"),
        );
    };
    match log.up(sensor.configured.up, recorded.format) {
        Ok(expected) => Check::new(
            name,
            Some(up == expected),
            format!(
                "{} turns as the radar, {} points up; {measured}",
                up.name(),
                expected.name()
            ),
        ),
        Err(error) => Check::new(name, Some(false), error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive of 60 s through a bend, at 4 Hz, with this scale and sense.
    fn drive(scale: f64, sense: f64) -> Trajectory {
        let second = |k: i64| k as f64 * 0.25;
        let place = |k: i64| {
            let (along, bend) = (8.0 * second(k), 0.02 * second(k).powi(2));
            let yaw = sense * (0.04 * second(k) / 8.0).atan();
            pose(scale * along, scale * sense * bend, yaw)
        };
        let stamps = (0..240).map(|k| k * 250_000_000);
        Trajectory::timed(stamps.collect(), (0..240).map(place).collect())
    }

    #[test]
    fn fixes_contradict_a_wrong_scale_and_a_mirrored_drive() {
        let fixes = || {
            let mut fixes = drive(1.0, 1.0);
            let places = fixes.poses.iter_mut();
            places.for_each(|place| place.rotation = pose(0.0, 0.0, 0.0).rotation);
            fixes
        };
        for (scale, sense, passes) in [
            (1.0, 1.0, true),
            (1.005, 1.0, true),
            (1.02, 1.0, false),
            (1.0, -1.0, false),
        ] {
            let check = against(&drive(scale, sense), fixes());
            assert_eq!(
                check.passes,
                Some(passes),
                "{scale} {sense}: {}",
                check.figure
            );
        }
        let elsewhere = fixes().earlier_by(1_000_000_000_000);
        assert_eq!(against(&drive(1.0, 1.0), elsewhere).passes, None);
        assert_eq!(
            against(&drive(1.0, 1.0), Trajectory::default()).passes,
            None
        );
    }

    #[test]
    fn a_drive_that_differs_backwards_is_bad() {
        for (length, turn_deg, passes) in
            [(0.004, 0.4, true), (-0.006, 0.0, false), (0.0, -0.6, false)]
        {
            let turn_rad_per_m = f64::to_radians(turn_deg) / 100.0;
            let check = reversed(&Reversal {
                length,
                turn_rad_per_m,
            });
            assert_eq!(check.passes, Some(passes), "{}", check.figure);
        }
    }

    #[test]
    fn a_run_without_loops_or_motions_is_not_determined() {
        let summary =
            |loops: Value| serde_json::json!({ "path_m": 1000.0, "slam": { "odometry": loops } });
        let of = |translation_rmse_m: f64| {
            loops(&summary(serde_json::json!({ "loops": 9, "translation_rmse_m": translation_rmse_m, "rotation_rmse_deg": 0.5 }))).passes
        };
        assert_eq!((of(4.0), of(6.0)), (Some(true), Some(false)));
        assert_eq!(loops(&summary(Value::Null)).passes, None);
        assert_eq!(motions(&Value::Null).passes, None);
    }
}
