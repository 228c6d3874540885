//! The logs of gyro, wheels and GNSS: their content, rates, spans and faults.

use std::path::{Path, PathBuf};

use gyre_geometry::samples::{Sample, SampleKind};
use gyre_radar::median;
use serde::Serialize;
use serde_json::{Value, json};

use super::{InspectedLogs, Report, timing::Timing};
use crate::{Dataset, LogError, SampleLog, sample_log::kinds::Kind};

/// The duration of the quietest time of the gyro, s.
const QUIET_S: f64 = 5.0;
/// Share of the samples that such a time has at least.
const QUIET_SHARE: f64 = 0.9;

pub(super) fn examine(
    report: &mut Report,
    dataset: &mut dyn Dataset,
    logs: &InspectedLogs,
    timing: Option<&Timing>,
) {
    for of in SampleKind::ALL {
        report.figure(of.section(), Value::Null);
    }
    for of in SampleKind::ALL {
        let kind = Kind::of(of);
        let Some((file, log)) = log(report, dataset, kind, logs) else {
            continue;
        };
        match log {
            Ok(log) => content(report, kind, &file, &log, timing),
            Err(error) => {
                let (section, name) = (of.section(), report.name_of(&file));
                report.line(section, format!("{name}: cannot be used"));
                let (one, name) = (kind.one, file.file_name().unwrap_or_default().display());
                report.find(format!(
                    "The log of {one}, {name}, cannot be used: {error}."
                ));
                report.figure(section, json!({"file": file, "error": error}));
            }
        }
    }
}

/// Reads the log in the recording or beside it, or returns why it cannot be used; `None` without
/// one.
fn log(
    report: &Report,
    dataset: &mut dyn Dataset,
    kind: &Kind,
    logs: &InspectedLogs,
) -> Option<(PathBuf, Result<SampleLog, String>)> {
    let (of, root) = (kind.of, report.root.clone());
    let in_recording = match of {
        SampleKind::Gnss => dataset.logged(of, logs.gnss_topic.as_deref()),
        _ => Ok(None),
    };
    let (file, log) = match in_recording {
        Ok(Some(logged)) => (root.clone(), SampleLog::of(of, logged, &root)),
        Err(error) => (root, Err(error.into())),
        Ok(None) => match SampleLog::find(of, &root) {
            Ok(file) => (file.clone(), SampleLog::read(of, &file, logs.m_per_tick)),
            Err(LogError::InTruth { path }) => {
                let why = "the ground truth was computed of it: name it in gyro.file to use it all the same";
                return Some((path, Err(why.to_owned())));
            }
            Err(_) => return None,
        },
    };
    Some((file, log.map_err(|error| error.to_string())))
}

fn content(
    report: &mut Report,
    kind: &Kind,
    file: &Path,
    log: &SampleLog,
    timing: Option<&Timing>,
) {
    let (of, section) = (kind.of, kind.of.section());
    let times = Times::of(log.samples.iter().map(|it| it.stamp_ns), timing);
    let contents = CONTENTS.iter().find(|(kind, _)| *kind == of);
    let Content {
        what,
        quiet,
        finding,
        mut figures,
    } = contents.map_or_else(Content::default, |(_, of)| of(log, times.period_s));
    let name = log.topic.clone().unwrap_or_else(|| report.name_of(file));
    times.lines(report, section, &format!("{name}: {what}"), kind.samples);
    if let Some(quiet) = quiet {
        report.line(format!("{section} quietest"), quiet);
    }
    for sentence in log.sentences().into_iter().chain(finding) {
        report.find(format!("{}: {sentence}", kind.title));
    }
    let lies = match &log.topic {
        Some(topic) => format!("{topic}{}, is in the bag", times.of_clocks()),
        None => format!("{} beside the scans", times.lies(file)),
    };
    let (one, uses) = (kind.one, kind.uses);
    let place = match of == SampleKind::Gnss && log.plane.is_none() {
        true => " Its plane is its own: the map has no place on the earth by it.",
        false => "",
    };
    report.find(format!("The log of {one}, {lies}: {uses} uses it.{place}"));
    figures["faults"] = log.fault_figures();
    if let Some(topic) = &log.topic {
        figures["topic"] = json!(topic);
    }
    report.figure(section, times.figures(file, figures));
}

/// Describes a log, by the period of its samples, s.
type Describe = fn(&SampleLog, f64) -> Content;

/// The content of the logs of a kind, by the period of their samples, s; of other kinds it is their
/// times alone.
const CONTENTS: [(SampleKind, Describe); 3] = [
    (SampleKind::Gyro, turns),
    (SampleKind::Wheels, |log, _| path(log)),
    (SampleKind::Gnss, |log, _| places(log)),
];

#[derive(Default)]
struct Content {
    what: String,
    quiet: Option<String>,
    /// The sentence after the sentences about faults.
    finding: Option<String>,
    figures: Value,
}

fn turns(log: &SampleLog, period_s: f64) -> Content {
    let up = log.up_by_gravity();
    let axis = up.map(|up| format!("by gravity its axis {} points up.", up.name()));
    let quiet = quiet(&log.samples, period_s);
    let text = |[x, y, z]: [f64; 3]| format!("{x:.3}, {y:.3}, {z:.3}");
    let in_words = quiet.as_ref().map(|quiet| {
        let (mean, sigma) = (text(quiet.mean_degps), text(quiet.sigma_degps));
        let after_s = quiet.after_s;
        format!(
            "{mean} deg/s about x, y, z, deviation {sigma}, in the 5 s from {after_s:.1} s on: bias and noise, if it stood"
        )
    });
    Content {
        what: String::new(),
        quiet: in_words,
        finding: axis,
        figures: json!({"quiet": quiet, "up_by_gravity": up}),
    }
}

fn path(log: &SampleLog) -> Content {
    let speeds = log.samples.iter().map(|sample| sample.values[0].abs());
    let fastest_mps = speeds.fold(0.0, f64::max);
    let steps = log.samples.windows(2).map(|pair| {
        0.5 * (pair[0].values[0] + pair[1].values[0]) * apart_s(pair[1].stamp_ns, pair[0].stamp_ns)
    });
    let path_m: f64 = steps.map(f64::abs).sum();
    Content {
        what: format!("{path_m:.0} m at up to {fastest_mps:.1} m/s, "),
        quiet: None,
        finding: None,
        figures: json!({"fastest_mps": fastest_mps, "path_m": path_m}),
    }
}

fn places(log: &SampleLog) -> Content {
    let first = log.samples.first().map_or([0.0; 2], Sample::place);
    let from_first = log.samples.iter().map(|fix| {
        let [east, north] = [0, 1].map(|axis| fix.values[axis] - first[axis]);
        east.hypot(north)
    });
    let reach_m = from_first.fold(0.0, f64::max);
    let sigma_m = median(log.samples.iter().filter_map(Sample::sigma_m));
    let sigma = sigma_m.map_or("no accuracy stated".to_owned(), |m| {
        format!("standard deviation {m:.2} m as stated")
    });
    Content {
        what: format!("up to {reach_m:.0} m from the first, {sigma}, "),
        quiet: None,
        finding: None,
        figures: json!({
            "on_the_earth": log.plane.is_some(),
            "reach_m": reach_m,
            "sigma_m": sigma_m,
        }),
    }
}

struct Times {
    samples: usize,
    /// Median time between samples, s.
    period_s: f64,
    /// RMS deviation of the time between samples from its median, s, without gaps.
    jitter_s: f64,
    /// First and last stamp, ns, on the log's own clock.
    span_ns: Option<[i64; 2]>,
    /// Samples that are missing between them, share of all.
    missing: f64,
    /// First and last stamp relative to the first and last scan, s.
    after_scans_s: Option<[f64; 2]>,
}

impl Times {
    fn of(stamps: impl Iterator<Item = i64>, timing: Option<&Timing>) -> Self {
        let stamps: Vec<i64> = stamps.collect();
        let steps = stamps.windows(2).map(|pair| apart_s(pair[1], pair[0]));
        let steps_s: Vec<f64> = steps.collect();
        let period_s = median(steps_s.iter().copied()).unwrap_or_default();
        let regular = steps_s.iter().map(|step_s| step_s - period_s);
        let regular: Vec<f64> = regular.filter(|apart_s| *apart_s < period_s).collect();
        let squares: f64 = regular.iter().map(|apart_s| apart_s * apart_s).sum();
        let span = stamps.first().copied().zip(stamps.last().copied());
        let seconds = |(first, last)| apart_s(last, first);
        let slots = span.map_or(0.0, |span| seconds(span) / period_s.max(1e-9) + 1.0);
        let after = |((first, last), timing): (_, &Timing)| {
            let begins_s = apart_s(first, timing.first_ns);
            [begins_s, apart_s(last, timing.last_ns)]
        };
        Self {
            samples: stamps.len(),
            period_s,
            jitter_s: (squares / regular.len().max(1) as f64).sqrt(),
            span_ns: span.map(Into::into),
            missing: (1.0 - stamps.len() as f64 / slots.max(1.0)).max(0.0),
            after_scans_s: span.zip(timing).map(after),
        }
    }

    fn rate_hz(&self) -> f64 {
        match self.period_s > 0.0 {
            true => 1.0 / self.period_s,
            false => 0.0,
        }
    }

    fn lines(&self, report: &mut Report, section: &str, what: &str, samples: &str) {
        let (count, rate_hz, missing) = (self.samples, self.rate_hz(), self.missing * 100.0);
        let content = format!("{what}{count} {samples} of {rate_hz:.1} Hz, {missing:.1} % missing");
        report.line(section, content);
        if let (Some([first, last]), Some([before, after])) = (self.span_ns, self.after_scans_s) {
            let (seconds, jitter_ms) = ((last - first) as f64 * 1e-9, self.jitter_s * 1e3);
            let span = format!(
                "{seconds:.1} s, from {before:+.2} s of the first scan to {after:+.2} s of the last, jitter {jitter_ms:.1} ms RMS"
            );
            report.line(format!("{section} stamps"), span);
        }
    }

    /// Returns the name of a log, with a note if its stamps do not cover the scans.
    fn lies(&self, file: &Path) -> String {
        let name = file.file_name().unwrap_or_default().display();
        format!("{name}{}, lies", self.of_clocks())
    }

    fn of_clocks(&self) -> &'static str {
        let after = self.after_scans_s;
        match after.is_none_or(|[first_s, last_s]| first_s <= 0.0 && last_s >= 0.0) {
            true => "",
            false => ", whose stamps do not cover those of the scans",
        }
    }

    fn figures(&self, file: &Path, mut more: Value) -> Value {
        for (name, value) in [
            ("file", json!(file)),
            ("error", Value::Null),
            ("samples", json!(self.samples)),
            ("rate_hz", json!(self.rate_hz())),
            ("jitter_s", json!(self.jitter_s)),
            ("span_ns", json!(self.span_ns)),
            ("missing", json!(self.missing)),
            ("after_scans_s", json!(self.after_scans_s)),
        ] {
            more[name] = value;
        }
        more
    }
}

fn apart_s(stamp_ns: i64, from_ns: i64) -> f64 {
    (i128::from(stamp_ns) - i128::from(from_ns)) as f64 * 1e-9
}

/// The rates of a quiet time: its start, s since the first sample, means and standard deviations.
#[derive(Serialize)]
struct Quiet {
    after_s: f64,
    mean_degps: [f64; 3],
    sigma_degps: [f64; 3],
}

/// Returns the time of [`QUIET_S`] with the smallest variance of the rates: the bias and the noise,
/// if the vehicle stood.
fn quiet(samples: &[Sample], period_s: f64) -> Option<Quiet> {
    let least = (QUIET_SHARE * QUIET_S / period_s.max(1e-9)) as usize;
    let windows = (0..samples.len()).step_by((least / 5).max(1)).map(|from| {
        let rest = &samples[from..];
        let since_s = |it: &Sample| apart_s(it.stamp_ns, samples[from].stamp_ns);
        let count = rest.partition_point(|it| since_s(it) < QUIET_S);
        &rest[..count]
    });
    let full = windows.filter(|window| window.len() >= least.max(2));
    let variance = |window: &[Sample]| moments(window).1.iter().sum::<f64>();
    let quietest = full.min_by(|a, b| variance(a).total_cmp(&variance(b)))?;
    let (mean, squares) = moments(quietest);
    Some(Quiet {
        after_s: apart_s(quietest.first()?.stamp_ns, samples.first()?.stamp_ns),
        mean_degps: mean.map(f64::to_degrees),
        sigma_degps: squares.map(|square| square.sqrt().to_degrees()),
    })
}

fn moments(samples: &[Sample]) -> ([f64; 3], [f64; 3]) {
    let count = samples.len() as f64;
    let mean = [0, 1, 2].map(|k| samples.iter().map(|it| it.values[k]).sum::<f64>() / count);
    let variance = [0, 1, 2].map(|k| {
        let squares = samples.iter().map(|it| (it.values[k] - mean[k]).powi(2));
        squares.sum::<f64>() / count
    });
    (mean, variance)
}
