//! `gyre ps`: the running runs and their processes.

use clap::Args;
use gyre_client::{RunError, UsedRun, control::Control};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::control::{Activity, Phase, ProcessStatus, Received, Status};

use crate::operate::RunChoice;

#[derive(Debug, Args)]
pub struct PsArguments {
    /// The run to list. Default: all runs of this user.
    #[command(flatten)]
    pub run: RunChoice,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Fail unless a run is running, and all processes of each run work as they should: for health
    /// checks.
    #[arg(long)]
    pub check: bool,
}

const NO_RUN: &str = "no run is running";

pub fn ps(arguments: &PsArguments) -> Result<(), Failure> {
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    let runs = match &arguments.run.run {
        Some(out) => vec![Control::of(out)?],
        None => Control::of_all(),
    };
    for run in runs {
        match run.status() {
            Ok(status) => rows.push(UsedRun::of(status)),
            // It has ended meanwhile.
            Err(RunError::NotRunning { .. }) => {}
            Err(error) => faults.push(error.to_string()),
        }
    }
    let is_none = rows.is_empty() && faults.is_empty();
    match arguments {
        PsArguments { check: true, .. } if is_none => return Err(NO_RUN.into()),
        PsArguments { check: true, .. } => {
            faults.extend(rows.iter().flat_map(|row| ills(&row.status)));
        }
        PsArguments { json: true, .. } => print::line(serde_json::to_string_pretty(&rows)?)?,
        _ if is_none => print::line(NO_RUN)?,
        _ => rows.iter().map(listed).try_for_each(print::line)?,
    }
    match faults.is_empty() {
        true => Ok(()),
        false => Err(faults.join("; ").into()),
    }
}

fn listed(UsedRun { status, usage }: &UsedRun) -> String {
    let (out, summary) = (status.out.display(), summary(status));
    let mut table = format!(
        "{out}\n{summary}\n  {:20} {:>8} {:9} {:>8} {:>9} {:>8} {:>9}\n",
        "process", "pid", "state", "for", "cpu", "memory", "restarts"
    );
    for (process, usage) in status.processes.iter().zip(usage) {
        let usage = usage.unwrap_or_default();
        let activity_s = process.activity_s.map(duration).unwrap_or_default();
        table += &format!(
            "  {:20} {:>8} {:9} {activity_s:>8} {:>7.1} s {:>5.0} MB {:>9}{}\n",
            process.name,
            process.pid,
            process.activity.name(),
            usage.cpu_s,
            usage.own_bytes as f64 * 1e-6,
            process.restarts,
            remarks(process),
        );
    }
    table
}

fn ills(status: &Status) -> Vec<String> {
    let out = status.out.display();
    let is_ill = |activity| matches!(activity, Activity::Silent | Activity::Ended);
    // Followers end one after the other when the stream has.
    let ends = status.phase == Phase::Following;
    let ill = status.processes.iter().filter(|it| is_ill(it.activity));
    let ill = ill.filter(|it| !(ends && it.activity == Activity::Ended));
    let ill = ill.map(|it| format!("{out}: {} is {}", it.name, it.activity.name()));
    let received = status.processes.iter().filter_map(|it| it.received);
    let deaf = received.filter(|it| !it.is_receiving && status.phase == Phase::WaitingForRadar);
    let deaf = deaf.map(|it| {
        let again = it.reconnections();
        format!("{out}: no azimuths arrive from the radar, {again} reconnections so far")
    });
    let starting = (status.phase == Phase::Starting).then(|| format!("{out} is starting"));
    let notice = status.notice.iter().map(|it| format!("{out}: {it}"));
    let all = starting.into_iter().chain(notice);
    all.chain(ill).chain(deaf).collect()
}

pub fn summary(status: &Status) -> String {
    let mode = if status.live { "live" } else { "lossless" };
    let uptime = duration(status.uptime_s);
    let phase = match status.phase {
        Phase::WaitingForRadar => format!("waiting for radar, up for {uptime}"),
        phase => format!("{} for {uptime}", phase.name()),
    };
    let (pid, poses, dropped) = (status.pid, status.poses, status.dropped);
    let age = status.last_pose_s.map(duration);
    let age = age
        .map(|age| format!(", the last {age} ago"))
        .unwrap_or_default();
    let notice = status.notice.as_ref().map(|it| format!("; {it}"));
    let notice = notice.unwrap_or_default();
    format!("{phase}, {mode}, supervised by {pid}: {poses} poses{age}, {dropped} dropped{notice}")
}

fn remarks(process: &ProcessStatus) -> String {
    let mut remarks = String::new();
    if let Some(death) = &process.last_death {
        remarks += &format!("  died by {death}");
    }
    if let Some(missed) = process.missed.filter(|missed| *missed > 0) {
        remarks += &format!("  missed {missed} messages");
    }
    if let Some(received) = &process.received {
        remarks += &lacks(received);
    }
    if process.is_swapped {
        remarks += &format!("  is `{}`", process.command.join(" "));
    }
    remarks
}

pub fn lacks(received: &Received) -> String {
    let counts = [
        (received.scans_left_out, "scans left out"),
        (received.missing_azimuths, "azimuths missing"),
        (received.damaged_messages, "messages damaged"),
        (received.foreign_messages, "messages of others"),
        (received.reconnections(), "reconnections"),
    ];
    let mut lacks = match received.is_receiving {
        true => String::new(),
        false => "  no azimuths".to_owned(),
    };
    for (count, of) in counts.into_iter().filter(|(count, _)| *count > 0) {
        lacks += &format!("  {count} {of}");
    }
    lacks
}

pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 0.9995 => format!("{:.0} ms", s * 1e3),
        s if s < 99.5 => format!("{s:.1} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
