//! `summary.json`, and the same as a table.

mod counts;
mod ending;
mod gnss;
mod sensors;
mod slam;

use std::{collections::BTreeMap, fmt, path::Path, time::Duration};

use gyre_configuration::Configuration;
use gyre_contract::{
    CommandError, Commands, Footprint, StageId,
    run::{
        Ending, Mode, Rate, Report, StageCounters, Swapped,
        latency::{Latency, Percentiles},
    },
};
use gyre_masking::{MaskKind, MaskingConfig};
use serde::Serialize;
use serde_json::{Value, json};

use crate::{figures, judgement::Judgement, machine::Machine};

pub use counts::{Counter, Counts, Course};
pub use gnss::GnssSummary;
pub use slam::SlamSummary;

pub struct Session<'a> {
    /// Scans to play; `None`: without end.
    pub scans: Option<usize>,
    pub resumed: usize,
    /// A sentence about damaged or missing parts of the recording.
    pub damage: Option<&'a str>,
    /// True if each scan that cannot be read is a problem: of recordings of runs and bags, whose
    /// scans were read once.
    pub needs_all: bool,
    pub wall: Duration,
    /// Shared memory; `None` if no process was started, because only results were missing.
    pub footprint: Option<&'a Footprint>,
    /// The end; `None`: it failed.
    pub ending: Option<Ending>,
    /// The supervisor's report; `None` if it failed or no process was started.
    pub report: Option<&'a Report>,
}

/// Returns the network of the masks: its model, the SHA-256 of its file, and the library that
/// computes it.
fn network(masking: &MaskingConfig) -> Option<Value> {
    let (model, sha256) = (masking.model.as_ref()?, masking.sha256.as_ref()?);
    (masking.kind == MaskKind::Learned).then(|| {
        json!({
            "model": model.display().to_string(),
            "sha256": sha256,
            "backend": masking.backend,
        })
    })
}

/// The words of a problem of motions that have few firm matches.
pub const HARDLY_MEASURED: &str = "the radar hardly measured this trajectory";

/// Returns why the results of a run that has played all scans are unreliable.
fn problem(data: &str, out: &Path, session: &Session<'_>, counts: &Counts) -> Option<String> {
    let scans = session.scans.unwrap_or(counts.processed as usize);
    let log = out.join("log.jsonl");
    let (poses, unreadable, log) = (counts.processed, counts.unreadable, log.display());
    let sentence = if session.ending != Some(Ending::Complete) {
        return None;
    } else if poses < 2 {
        format!(
            "only {poses} of the {scans} scans of {data} can be read, and a motion is between two: {log} has the reasons"
        )
    } else if let Some(damage) = session.damage {
        let missing = counts.missing;
        format!(
            "{damage}; {unreadable} scans cannot be read and {missing} are missing by their times, and the results are of the others: `gyre inspect {data}` names all that is damaged"
        )
    } else if counts.too_many_are_unreadable() || (session.needs_all && unreadable > 0) {
        format!(
            "{unreadable} of the {scans} scans of {data} cannot be read: the results are of the others, and {log} has the reason for each"
        )
    } else {
        let it = counts.too_many_are_unsure()?;
        let all = it.refined + it.doubtful;
        let cause = match counts.dropped {
                0 => "The mask keeps too little, or a constant in [dataset] is wrong: `gyre masks` and `gyre inspect` show which".to_owned(),
                dropped => format!("{dropped} scans were dropped, and motions over dropped scans are long: `gyre stress` finds the rate that this machine keeps up with"),
            };
        let (weak, predicted) = (it.weak, it.predicted);
        format!(
            "{weak} weak and {predicted} predicted motions of {all}: {HARDLY_MEASURED}. {cause}"
        )
    };
    Some(sentence)
}

/// Returns why commands with a first scan have changed nothing.
fn unapplied(commands: &Result<Commands, CommandError>, counts: &Counts) -> Option<String> {
    let given = match commands {
        Ok(commands) => commands.len() - commands.waiting(),
        Err(error) => return Some(error.to_string()),
    };
    let applied = counts.commands.unwrap_or_default();
    (applied < given).then(|| {
        format!(
            "{applied} of {given} commands have changed poses: the others are of times after the last scan"
        )
    })
}

#[derive(Debug)]
pub struct Measured {
    pub counts: Counts,
    pub course: Course,
    pub latency: Latency,
    pub evaluation: Option<Judgement>,
    pub slam: Option<SlamSummary>,
    pub gnss: Option<GnssSummary>,
}

/// The summary of a run: `summary.json`.
#[derive(Debug, Serialize)]
pub struct Summary {
    version: &'static str,
    machine: Machine,
    out: String,
    data: String,
    /// `None`: the run failed.
    ending: Option<Ending>,
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
    mode: Mode,
    rate: Rate,
    window: usize,
    /// `None`: no network makes the masks.
    #[serde(skip_serializing_if = "Option::is_none")]
    mask: Option<Value>,
    /// `None`: a radar's, without end.
    #[serde(skip_serializing_if = "Option::is_none")]
    scans_in_recording: Option<usize>,
    resumed_after: usize,
    #[serde(flatten)]
    course: Course,
    #[serde(flatten)]
    counts: Counts,
    /// Commands that no scan has taken, after the last one; `None`: they have taken all.
    #[serde(skip_serializing_if = "Option::is_none")]
    commands_without_scan: Option<u64>,
    wall_s: f64,
    scans_per_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_memory: Option<Footprint>,
    restarts: BTreeMap<String, usize>,
    recovery_ms: Vec<f64>,
    /// The programs that took the place of others, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    swaps: Vec<Swapped>,
    /// Counters of each stage since its last start.
    stages: BTreeMap<String, StageCounters>,
    latency: Latency,
    /// As `gyre evaluate --json` prints it.
    evaluation: Option<Judgement>,
    /// `None`: the trajectory is not corrected by loops.
    #[serde(skip_serializing_if = "Option::is_none")]
    slam: Option<SlamSummary>,
    /// `None`: the trajectory is not corrected by GNSS.
    #[serde(skip_serializing_if = "Option::is_none")]
    gnss: Option<GnssSummary>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Brief,
    Table,
    Json,
}

impl Summary {
    pub fn text(&self, form: Form) -> serde_json::Result<String> {
        match form {
            Form::Brief => Ok(self.in_brief()),
            Form::Table => Ok(self.to_string()),
            Form::Json => serde_json::to_string_pretty(self),
        }
    }

    fn figures(&self) -> Value {
        // A figure that JSON cannot hold is null there.
        serde_json::to_value(self).unwrap_or_default()
    }

    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    pub fn new(
        configuration: &Configuration,
        out: &Path,
        session: &Session<'_>,
        measured: Measured,
    ) -> Self {
        let has_ended = session.ending == Some(Ending::Complete)
            || session.ending.is_some() && configuration.is_radar();
        let (counts, gnss) = (&measured.counts, measured.gnss.as_ref());
        let of_sensors = || sensors::problem(configuration, counts, gnss);
        let commands = Commands::open(out);
        let problem = problem(&configuration.data(), out, session, counts)
            .or_else(|| of_sensors().filter(|_| has_ended))
            .or_else(|| unapplied(&commands, counts).filter(|_| has_ended));
        let (wall_s, report) = (session.wall.as_secs_f64(), session.report);
        let recovery = report.into_iter().flat_map(|report| &report.recovery);
        Self {
            version: env!("CARGO_PKG_VERSION"),
            machine: Machine::this(),
            out: out.display().to_string(),
            problem,
            data: configuration.data(),
            ending: session.ending,
            mode: configuration.run.mode,
            rate: configuration.run.rate,
            window: configuration.run.window,
            mask: network(&configuration.odometry.masking),
            scans_in_recording: session.scans,
            resumed_after: session.resumed,
            course: measured.course,
            counts: measured.counts,
            commands_without_scan: commands.ok().map(|it| it.waiting()).filter(|it| *it > 0),
            wall_s,
            scans_per_s: measured.latency.scans as f64 / wall_s.max(f64::MIN_POSITIVE),
            shared_memory: session.footprint.cloned(),
            restarts: report.map_or_else(Default::default, |it| it.restarts.clone()),
            recovery_ms: recovery.map(|time| time.as_secs_f64() * 1e3).collect(),
            swaps: report.map_or_else(Default::default, |it| it.swaps.clone()),
            stages: report.map_or_else(Default::default, |it| it.counters.clone()),
            latency: measured.latency,
            evaluation: measured.evaluation,
            slam: measured.slam,
            gnss: measured.gnss,
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let c = &self.counts;
        let ending = match self.ending {
            Some(Ending::Complete) if c.unreadable > 0 => "complete but for unreadable scans",
            Some(Ending::Complete) => "complete",
            Some(Ending::Interrupted) => "interrupted: the same command resumes from here",
            None => "failed",
        };
        let of = self.scans_in_recording;
        let of = of.map_or(String::new(), |scans| format!(" of {scans}"));
        let (poses, wall_s, per_s) = (c.processed, self.wall_s, self.scans_per_s);
        writeln!(
            f,
            "\n{ending}: {poses}{of} scans in {wall_s:.1} s, {per_s:.1} scans/s"
        )?;
        let figures = self.figures();
        let groups = figures::GROUPS.iter();
        for (title, rows) in groups.filter(|it| it.0 != figures::ACCURACY) {
            writeln!(f, "\n{title}")?;
            for row in rows {
                if let Some(text) = row.text(&figures) {
                    writeln!(f, "  {:41}{text}", row.name)?;
                }
            }
        }
        self.latency_table(f)?;
        if let Some(evaluation) = &self.evaluation {
            writeln!(f, "\n{evaluation}")?;
        }
        let corrected = match self.slam {
            Some(_) => ", trajectory_slam.tum, loops.csv, graph.g2o, map.png",
            None => "",
        };
        write!(
            f,
            "\nresults in {}: odometry.csv, poses.csv, trajectory.tum, trajectory.svg{corrected}, latency.json, summary.json",
            self.out
        )
    }
}

impl Summary {
    fn latency_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = "latency, us";
        write!(f, "\n{name:20}      p50      p90      p99      max   ")?;
        writeln!(f, "busy   allocations")?;
        row(f, "sensor to pose", &self.latency.sensor_to_pose)?;
        writeln!(f)?;
        for stage in StageId::ALL {
            let Some(hop) = self.latency.stages.get(stage.name()) else {
                continue;
            };
            if let Some(transport) = &hop.transport {
                row(f, "  transport", transport)?;
                writeln!(f)?;
            }
            row(f, stage.name(), &hop.work)?;
            write!(f, "{:6.0} %", hop.busy * 100.0)?;
            let counters = self.stages.get(stage.name());
            if let Some(allocations) = counters.and_then(|it| it.allocations_after_five) {
                write!(f, "{allocations:14}")?;
            }
            writeln!(f)?;
        }
        let bound_by = self.latency.bound_by.unwrap_or("nothing");
        writeln!(
            f,
            "bounded by {bound_by}; two or more stages busy at once {:.0} % of the time\n\
             allocations: in `process` after its first five items",
            self.latency.overlap * 100.0
        )
    }
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, p: &Percentiles) -> fmt::Result {
    write!(f, "{name:20}")?;
    let mut times_us = [p.p50_us, p.p90_us, p.p99_us, p.max_us].into_iter();
    times_us.try_for_each(|time_us| write!(f, "{time_us:9.0}"))
}
