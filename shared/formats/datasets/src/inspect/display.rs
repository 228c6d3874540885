//! The printed form of the report.

use std::fmt;
use std::path::Path;

use super::{
    Chirps, GnssReport, GroundTruthReport, GyroReport, LogTimes, Report, TimingReport,
    VelocityReport, WheelReport,
};

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.root.display())?;
        line(f, "format", format_args!("{}", self.format))?;
        let read = if self.scans_read < self.scans {
            format!(" ({} of them read)", self.scans_read)
        } else {
            String::new()
        };
        line(f, "scans", format_args!("{}{read}", self.scans))?;
        let side = if self.transposed {
            ", transposed (range x azimuth)"
        } else {
            ""
        };
        line(f, "images", format_args!("{}{side}", self.image))?;
        line(
            f,
            "sweep",
            format_args!(
                "{} azimuths x {} range bins, clockwise",
                self.azimuths, self.bins
            ),
        )?;
        let offset = if self.range_offset_m == 0.0 {
            String::new()
        } else {
            format!(", offset {} m", self.range_offset_m)
        };
        line(
            f,
            "range",
            format_args!(
                "{:.6} m per bin{offset}, to {:.1} m",
                self.range_resolution_m, self.max_range_m
            ),
        )?;
        self.azimuth_line(f)?;
        self.row_line(f)?;
        if let Some(velocity) = &self.velocity {
            velocity_line(f, velocity)?;
        }
        if let Some(timing) = &self.timing {
            timing_lines(f, timing)?;
        }
        line(f, "stamps", format_args!("{}", self.stamp_meaning))?;
        for truth in &self.ground_truths {
            truth_line(f, truth, &self.root)?;
        }
        if self.ground_truths.is_empty() {
            line(f, "ground truth", format_args!("none found"))?;
        }
        if let Some(gyro) = &self.gyro {
            gyro_lines(f, gyro, &self.root)?;
        }
        if let Some(wheels) = &self.wheels {
            wheel_lines(f, wheels, &self.root)?;
        }
        if let Some(gnss) = &self.gnss {
            gnss_lines(f, gnss, &self.root)?;
        }
        writeln!(f, "findings")?;
        self.findings
            .iter()
            .try_for_each(|sentence| writeln!(f, "  - {sentence}"))
    }
}

impl Report {
    fn azimuth_line(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let source = self.encoder_counts.map_or("uniform".to_owned(), |counts| {
            format!("encoder of {counts} counts per turn")
        });
        let (min, max) = self.rows.first_azimuth_deg;
        let first = if max - min < 0.005 {
            format!("{min:.2}")
        } else {
            format!("{min:.2} to {max:.2}")
        };
        line(
            f,
            "azimuths",
            format_args!(
                "{source}, step {:.3} deg, first at {first} deg",
                self.rows.step_deg
            ),
        )
    }

    fn row_line(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let chirps = match self.rows.chirps {
            Chirps::Unknown => "unknown",
            Chirps::Alternating => "alternating",
            Chirps::Mixed => "known in some scans",
        };
        let (rows, lost) = (&self.rows, self.rows.lost);
        line(
            f,
            "rows",
            format_args!(
                "{}, {} not measured, {lost} lost; chirps {chirps}",
                rows.rows, rows.not_measured
            ),
        )
    }
}

fn line(f: &mut fmt::Formatter<'_>, name: &str, value: fmt::Arguments<'_>) -> fmt::Result {
    writeln!(f, "  {name:<13} {value}")
}

fn velocity_line(f: &mut fmt::Formatter<'_>, found: &VelocityReport) -> fmt::Result {
    let (Some([ahead, left]), Some([of_ahead, of_left])) = (found.velocity_mps, found.sigma_mps)
    else {
        let reason = found.error.as_deref().unwrap_or_default();
        return line(f, "velocity", format_args!("unknown: {reason}"));
    };
    let bearings = found.bearings;
    line(
        f,
        "velocity",
        format_args!(
            "{ahead:.2} +- {of_ahead:.2} m/s ahead, {left:.2} +- {of_left:.2} m/s to the left, by the Doppler shift of {bearings} bearings of the last scan read"
        ),
    )
}

fn timing_lines(f: &mut fmt::Formatter<'_>, timing: &TimingReport) -> fmt::Result {
    let seconds = (timing.last_ns - timing.first_ns) as f64 * 1e-9;
    let start = timing.first_ns as f64 * 1e-9;
    line(
        f,
        "time",
        format_args!("{start:.3} s since 1970, for {seconds:.3} s"),
    )?;
    if timing.period_s == 0.0 {
        return Ok(());
    }
    let (max, min) = timing.logged_interval_s;
    let (period, jitter) = (timing.period_s, timing.jitter_s * 1e3);
    line(
        f,
        "period",
        format_args!(
            "{period:.4} s; logged {min:.3} to {max:.3} s apart, jitter {jitter:.1} ms RMS"
        ),
    )?;
    line(
        f,
        "gaps",
        format_args!(
            "{} scans missing in {} places; {} host stalls",
            timing.missing_scans,
            timing.gaps.len(),
            timing.stalls.len()
        ),
    )
}

fn truth_line(f: &mut fmt::Formatter<'_>, truth: &GroundTruthReport, root: &Path) -> fmt::Result {
    let name = truth
        .file
        .strip_prefix(root)
        .unwrap_or(&truth.file)
        .display();
    if truth.error.is_some() {
        return line(f, "ground truth", format_args!("{name}: cannot be read"));
    }
    let span = truth.span_ns.map_or("no times".to_owned(), |(a, b)| {
        format!("{:.1} s", (b - a) as f64 * 1e-9)
    });
    let covered = truth
        .scans_covered
        .map_or(String::new(), |n| format!(", covers {n} scans"));
    let nearest = truth.nearest_pose_s.map_or(String::new(), |s| {
        format!(", median distance of the nearest pose {:.1} ms", s * 1e3)
    });
    let clock = match &truth.clock {
        Some(clock) if clock.agrees() => format!(", clock agrees ({:+.2} s)", clock.late_s),
        Some(clock) if clock.is_reliable() => format!(", clock {:+.2} s", clock.late_s),
        Some(_) => ", clock unknown".to_owned(),
        None => String::new(),
    };
    let (poses, metres) = (truth.poses, truth.path_length_m);
    line(
        f,
        "ground truth",
        format_args!("{name}: {poses} poses, {metres:.1} m, {span}{covered}{nearest}{clock}"),
    )
}

fn gyro_lines(f: &mut fmt::Formatter<'_>, gyro: &GyroReport, root: &Path) -> fmt::Result {
    let name = gyro.file.strip_prefix(root).unwrap_or(&gyro.file).display();
    if gyro.error.is_some() {
        return line(f, "gyro", format_args!("{name}: cannot be used"));
    }
    log_lines(f, "gyro", format_args!("{name}: "), "samples", &gyro.times)?;
    if let Some(quiet) = &gyro.quiet {
        let [mean, sigma] = [quiet.mean_degps, quiet.sigma_degps]
            .map(|[x, y, z]| format!("{x:.3}, {y:.3}, {z:.3}"));
        line(
            f,
            "gyro quietest",
            format_args!(
                "{mean} deg/s about x, y, z, deviation {sigma}, in the 5 s from {:.1} s on: bias and noise, if it stood",
                quiet.after_s
            ),
        )?;
    }
    Ok(())
}

fn wheel_lines(f: &mut fmt::Formatter<'_>, wheels: &WheelReport, root: &Path) -> fmt::Result {
    let file = &wheels.file;
    let name = file.strip_prefix(root).unwrap_or(file).display();
    if wheels.error.is_some() {
        return line(f, "wheels", format_args!("{name}: cannot be used"));
    }
    let (path_m, fastest_mps) = (wheels.path_m, wheels.fastest_mps);
    let driven = format_args!("{name}: {path_m:.0} m at up to {fastest_mps:.1} m/s, ");
    log_lines(f, "wheels", driven, "samples", &wheels.times)
}

fn gnss_lines(f: &mut fmt::Formatter<'_>, gnss: &GnssReport, root: &Path) -> fmt::Result {
    let name = match &gnss.topic {
        Some(topic) => Path::new(topic),
        None => gnss.file.strip_prefix(root).unwrap_or(&gnss.file),
    };
    let name = name.display();
    if gnss.error.is_some() {
        return line(f, "gnss", format_args!("{name}: cannot be used"));
    }
    let sigma = gnss.sigma_m.map_or("no accuracy stated".to_owned(), |m| {
        format!("standard deviation {m:.2} m as stated")
    });
    let reach_m = gnss.reach_m;
    let places = format_args!("{name}: up to {reach_m:.0} m from the first, {sigma}, ");
    log_lines(f, "gnss", places, "fixes", &gnss.times)
}

/// Writes what a log has, how often, and when.
fn log_lines(
    f: &mut fmt::Formatter<'_>,
    name: &str,
    what: fmt::Arguments<'_>,
    samples: &str,
    times: &LogTimes,
) -> fmt::Result {
    let (count, rate_hz, missing) = (times.samples, times.rate_hz, times.missing * 100.0);
    line(
        f,
        name,
        format_args!("{what}{count} {samples} of {rate_hz:.1} Hz, {missing:.1} % missing"),
    )?;
    let (Some([first, last]), Some([before, after])) = (times.span_ns, times.after_scans_s) else {
        return Ok(());
    };
    let (seconds, jitter_ms) = ((last - first) as f64 * 1e-9, times.jitter_s * 1e3);
    line(
        f,
        &format!("{name} stamps"),
        format_args!(
            "{seconds:.1} s, from {before:+.2} s of the first scan to {after:+.2} s of the last, jitter {jitter_ms:.1} ms RMS"
        ),
    )
}
