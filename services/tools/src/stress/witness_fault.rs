//! Faults of gyro, wheels and radar: the source plays them, and the motions must report them.

use gyre_contract::{
    Basis, PoseHeader, RefinementRecord, StageId, Witness, WitnessCounts, flag,
    run::{PlayedFault, PlayedFaultKind, Scenario},
    verdict,
};
use serde::Serialize;

use crate::stress::{Others, TestedPipeline};

/// The begin of the first fault, s after the stamp of the first scan: twice the warm-up.
const FROM_S: f64 = 4.0;
const FOR_S: f64 = 3.0;
const BLIND_S: [f64; 3] = [2.0, 5.0, 10.0];
/// The time after a fault for the recovery of the run, s.
const AFTER_S: f64 = 4.0;
/// Way of a vehicle that drives while its wheels slip, m.
const LEAST_WAY_M: f64 = 1.0;

/// Returns the faults that a scenario adds to the played data, in order.
pub fn faults(scenario: Scenario) -> Vec<PlayedFault> {
    let (kind, durations) = match scenario {
        Scenario::GyroOut => (PlayedFaultKind::GyroOut, &[FOR_S][..]),
        Scenario::WheelsSlip => (PlayedFaultKind::WheelsSlip, &[FOR_S][..]),
        Scenario::ClockJump => (PlayedFaultKind::ClockJump, &[FOR_S][..]),
        Scenario::RadarBlind => (PlayedFaultKind::RadarBlind, &BLIND_S[..]),
        _ => return Vec::new(),
    };
    let (mut from_s, mut faults) = (FROM_S, Vec::new());
    for &for_s in durations {
        faults.push(PlayedFault {
            kind,
            from_s,
            for_s,
        });
        from_s += for_s + AFTER_S;
    }
    faults
}

/// Returns how much of the recording these faults and the recovery from them take, s.
pub fn needed_s(faults: &[PlayedFault]) -> f64 {
    faults.last().map_or(0.0, |last| last.ends_s() + AFTER_S)
}

/// Returns the sensors that a fault concerns and their name in a sentence. A run needs one of them.
fn concerned(kind: PlayedFaultKind) -> (&'static [Witness], &'static str) {
    match kind {
        PlayedFaultKind::GyroOut => (&[Witness::Gyro], "a gyro, and gyro.kind is none"),
        PlayedFaultKind::WheelsSlip => (&[Witness::Wheels], "wheels, and wheels.kind is none"),
        PlayedFaultKind::ClockJump | PlayedFaultKind::RadarBlind => (
            &[Witness::Gyro, Witness::Wheels],
            "a gyro or wheels, and gyro.kind and wheels.kind are none",
        ),
    }
}

/// Returns the reason why a scenario cannot be carried out with a pipeline.
pub fn lacks(tested: &TestedPipeline, scenario: Scenario) -> Option<String> {
    let faults = faults(scenario);
    let (kinds, lacking) = concerned(faults.first()?.kind);
    let others = &tested.others;
    if !kinds.iter().any(|kind| others.used[*kind as usize]) {
        return Some(format!(
            "{scenario} needs {lacking}: play a recording with its logs beside the scans and set gyro.kind=auto or wheels.kind=auto, or a simulation with simulation.gyro.profile and simulation.wheels.rate_hz"
        ));
    }
    if !others.are_weighed {
        return Some(format!(
            "{scenario} needs motions that say what they rest on, and refinement.kind is none: set it to local-map"
        ));
    }
    let has_s = tested.turn.len() as f64 * tested.period.as_secs_f64();
    let needed_s = needed_s(&faults);
    (has_s < needed_s).then(|| {
        format!(
            "{scenario} needs {needed_s:.0} s of a drive without a jump, and the recording lasts {has_s:.0} s: give a longer one, or raise simulation.scans"
        )
    })
}

/// A fault of gyro, wheels or radar, and how the motions reported it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WitnessFault {
    pub kind: PlayedFaultKind,
    /// The start of the fault, s since the measurement began.
    pub at_s: f64,
    pub for_s: f64,
    pub motions: u64,
    /// The number of these motions that report the fault.
    pub noticed: u64,
    pub counts: WitnessCounts,
    /// Time from its end to the first pose of a motion that is as before it, ms; `None`: there was
    /// no such pose before the next fault.
    pub recovery_ms: Option<f64>,
    way_m: f64,
}

impl WitnessFault {
    pub fn problem(&self) -> Option<String> {
        let (name, for_s, motions) = (self.kind.name(), self.for_s, self.motions);
        match self.recovery_ms {
            _ if self.noticed == 0 => Some(format!(
                "nothing has noticed the fault ({name}, {for_s} s) in {motions} motions"
            )),
            None => Some(format!(
                "no motion after the fault ({name}, {for_s} s) was as before it"
            )),
            Some(_) => None,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct PlayedClock {
    /// The stamp of the first scan, ns since 1970.
    pub first_ns: i64,
    /// Time between two scans, ns.
    pub period_ns: i64,
    /// Seconds that are played in a second.
    pub rate: f64,
    /// The end of the first turn: the number of the first scan that is not in it.
    pub end: u64,
}

impl PlayedClock {
    fn time_s(&self, pose: &PoseHeader) -> f64 {
        (pose.item.stamp_ns - self.first_ns) as f64 * 1e-9
    }

    /// Returns when a time of the recording was due, `CLOCK_MONOTONIC`, ns, by a scan: that is due
    /// when its sweep is complete, half a period after its stamp.
    fn due_ns(&self, pose: &PoseHeader, time_s: f64) -> f64 {
        let complete_s = self.time_s(pose) + 0.5e-9 * self.period_ns as f64;
        pose.item.due_ns as f64 + 1e9 * (time_s - complete_s) / self.rate
    }
}

#[derive(Debug)]
pub struct WitnessFaults {
    faults: Vec<PlayedFault>,
    others: Others,
    clock: PlayedClock,
    /// The begin of the measurement, `CLOCK_MONOTONIC`, ns.
    began_ns: i64,
    newest: Option<u64>,
    /// Motions before the first fault, and the normal ones among them.
    before: [u64; 2],
    found: Vec<WitnessFault>,
}

impl WitnessFaults {
    pub fn new(
        faults: Vec<PlayedFault>,
        others: Others,
        clock: PlayedClock,
        began_ns: i64,
    ) -> Self {
        let found = |fault: &PlayedFault| WitnessFault {
            kind: fault.kind,
            for_s: fault.for_s,
            ..WitnessFault::default()
        };
        Self {
            found: faults.iter().map(found).collect(),
            faults,
            others,
            clock,
            began_ns,
            newest: None,
            before: [0; 2],
        }
    }

    /// Adds the next pose; one that was added before, or is of a later turn of the recording, is
    /// left out.
    pub fn pose(&mut self, pose: &PoseHeader) {
        let item = &pose.item;
        let is_new = self.newest.is_none_or(|newest| item.seq > newest);
        if !is_new || item.is(flag::BREAK) || item.scan >= self.clock.end {
            return;
        }
        self.newest = Some(item.seq);
        let (time_s, motion) = (self.clock.time_s(pose), &pose.motion.refinement);
        let others = self.others;
        if let Some(first) = self.faults.first().filter(|it| time_s < it.from_s) {
            self.before[0] += 1;
            self.before[1] += u64::from(is_normal(first.kind, others, motion));
        }
        // The motion to the first scan after a fault begins within it.
        let period_s = 1e-9 * self.clock.period_ns as f64;
        let ends_s = self.faults.iter().skip(1).map(|next| next.from_s);
        let ends_s: Vec<f64> = ends_s.chain([f64::INFINITY]).collect();
        let all = self.faults.iter().zip(&mut self.found).zip(ends_s);
        for ((fault, found), next_s) in all {
            if (fault.from_s..fault.ends_s() + period_s).contains(&time_s) {
                let due_ns = self.clock.due_ns(pose, fault.from_s);
                found.at_s = 1e-9 * (due_ns - self.began_ns as f64);
                found.motions += 1;
                found.noticed += u64::from(is_noticed(fault.kind, others, motion));
                found.counts.add(motion);
                found.way_m += pose.motion.x_m.hypot(pose.motion.y_m);
            }
            let is_after = (fault.ends_s()..next_s).contains(&time_s);
            if is_after && found.recovery_ms.is_none() && is_normal(fault.kind, others, motion) {
                let posed_ns = item.hops[StageId::PoseIntegration as usize].published_ns;
                let ended_ns = self.clock.due_ns(pose, fault.ends_s());
                found.recovery_ms = Some((posed_ns as f64 - ended_ns) * 1e-6);
            }
        }
    }

    pub fn are_open(&self) -> bool {
        self.found.iter().any(|fault| fault.recovery_ms.is_none())
    }

    /// Returns all faults, and the reason why they are no result about the pipeline.
    pub fn finish(self) -> (Vec<WitnessFault>, Option<String>) {
        let stood = |fault: &WitnessFault| {
            fault.kind == PlayedFaultKind::WheelsSlip && fault.way_m < LEAST_WAY_M
        };
        let omitted = match self.before {
            [0, _] => Some("the fault came before the measurement had begun: stop other programs"),
            [_, 0] => Some(
                "no motion before the fault was by all that it concerns, so its end is unknown: see the end of a plain run",
            ),
            _ if self.found.iter().any(stood) => Some(
                "the vehicle stood while its wheels were to slip: play another part of the drive with source.first",
            ),
            _ => None,
        };
        (self.found, omitted.map(str::to_owned))
    }
}

/// Returns whether a motion is by all sensors that a fault concerns, as far as the run uses them.
fn is_normal(kind: PlayedFaultKind, others: Others, motion: &RefinementRecord) -> bool {
    let is_by = |it: &Witness| !others.used[*it as usize] || motion.of(*it).is_used();
    match kind {
        PlayedFaultKind::RadarBlind => {
            matches!(motion.basis(), Basis::RadarOnly | Basis::RadarAndOthers)
        }
        kind => concerned(kind).0.iter().all(is_by),
    }
}

/// Returns whether a motion is without each sensor that a fault concerns and the run uses.
fn is_noticed(kind: PlayedFaultKind, others: Others, motion: &RefinementRecord) -> bool {
    let is_without = |it: &Witness| !others.used[*it as usize] || !motion.of(*it).is_used();
    match kind {
        PlayedFaultKind::RadarBlind => motion.basis().is_degraded(),
        PlayedFaultKind::WheelsSlip => motion.of(Witness::Wheels).verdict == verdict::REFUSED,
        kind => concerned(kind).0.iter().all(is_without),
    }
}

#[cfg(test)]
mod tests;
