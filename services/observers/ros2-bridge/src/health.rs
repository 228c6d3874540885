//! The health of the run as diagnostics, once a second.

use std::time::{Duration, Instant};

use gyre_client::{clock, control::Control};
use gyre_contract::control::{Activity, ProcessStatus, Status};
use gyre_ros2_messages::{
    builtin_interfaces::Time,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, ERROR, KeyValue, OK, STALE, WARN},
};

use crate::{
    outlet::Outlet,
    run_state::{POLL_INTERVAL, RunPhase, RunState, Shared},
};

const PERIOD: Duration = Duration::from_secs(1);

#[derive(Default)]
struct LastCounts {
    poses: u64,
    /// `None` before the supervisor has answered.
    dropped: Option<u64>,
    lost: u64,
}

pub fn report(shared: &Shared, mut diagnostics: Outlet<DiagnosticArray>) {
    let (mut before, mut due) = (LastCounts::default(), Instant::now());
    while !shared.is_stopping() {
        if Instant::now() >= due {
            due = Instant::now() + PERIOD;
            let answer = Control::of(&shared.settings.out).and_then(|run| run.status());
            let state = shared.state().clone();
            let mut array = array(&state, answer.ok(), &mut before);
            let lifecycle = shared.lifecycle.as_ref();
            let lifecycle =
                lifecycle.map(|node| KeyValue::new("state of the node", node.state().label));
            array.status[0].values.extend(lifecycle);
            let out = shared.settings.out.display().to_string();
            for part in &mut array.status {
                part.hardware_id.clone_from(&out);
            }
            diagnostics.send(array);
        }
        std::thread::sleep(POLL_INTERVAL.min(due.saturating_duration_since(Instant::now())));
    }
}

fn array(state: &RunState, status: Option<Status>, before: &mut LastCounts) -> DiagnosticArray {
    let mut array = DiagnosticArray::default();
    array.header.stamp = Time::from_ns(clock::since_1970_ns());
    array.status.push(run(state, status.as_ref(), before));
    let is_running = matches!(state.phase, RunPhase::Working | RunPhase::Finishing);
    let of_motions = state.motions.diagnostic().filter(|_| is_running);
    array.status.extend(of_motions);
    let processes = status.iter().flat_map(|status| &status.processes);
    array.status.extend(processes.map(process));
    array
}

fn run(state: &RunState, status: Option<&Status>, before: &mut LastCounts) -> DiagnosticStatus {
    let dropped = status.map(|status| status.dropped);
    let lost = state.lost();
    let drops = before.dropped.zip(dropped);
    let trouble = match drops.is_some_and(|(before, now)| now > before) {
        true => Some("scans are dropped"),
        false => (lost > before.lost).then_some("the bridge loses messages"),
    };
    let poses = state.poses.published.saturating_sub(before.poses);
    *before = LastCounts {
        poses: state.poses.published,
        dropped: dropped.or(before.dropped),
        lost,
    };
    let (level, message) = match (state.phase, trouble, &state.notice) {
        (RunPhase::Waiting, ..) => (STALE, "there is no run yet".to_owned()),
        (RunPhase::Ended, ..) => (STALE, "the run has ended".to_owned()),
        (_, _, Some(notice)) => (WARN, notice.clone()),
        (_, Some(trouble), _) => (WARN, trouble.to_owned()),
        (RunPhase::Finishing, ..) => (OK, "the results are being written".to_owned()),
        (RunPhase::Working, ..) => (OK, format!("{poses} poses in the last second")),
    };
    let of_bridge = [
        ("poses published", state.poses.published),
        ("poses missed", state.poses.missed()),
        ("poses behind a prediction", state.poses.left_out),
        ("poses between scans published", state.predictions.published),
        ("objects published", state.objects.published),
        ("objects missed", state.objects.missed()),
        ("poses without a reader", state.unread),
        ("poses held back, not active", state.poses.held_back),
        ("Doppler velocities published", state.doppler.published),
        ("Doppler velocities missed", state.doppler.missed()),
        ("fixes published", state.fixes.published),
        ("fixes missed", state.fixes.missed()),
        ("keyframes not found in the map", state.fixes.left_out),
        ("messages not sent", state.unsent),
        ("maps published", state.maps),
    ];
    let of_bridge = of_bridge.map(|(key, count)| KeyValue::new(key, count));
    let mut part = DiagnosticStatus::new("gyre", level, message);
    part.values = status.map(figures).unwrap_or_default();
    part.values.extend(of_bridge);
    part
}

fn figures(status: &Status) -> Vec<KeyValue> {
    let mut figures = vec![
        KeyValue::new("phase", status.phase.name()),
        KeyValue::new("mode", if status.live { "live" } else { "lossless" }),
        KeyValue::new("uptime_s", format!("{:.1}", status.uptime_s)),
        KeyValue::new("poses", status.poses),
        KeyValue::new("dropped", status.dropped),
    ];
    figures.extend(
        status
            .published
            .map(|scans| KeyValue::new("published", scans)),
    );
    let age = status.last_pose_s.map(|age_s| format!("{age_s:.2}"));
    figures.extend(age.map(|age_s| KeyValue::new("last_pose_s", age_s)));
    figures
}

fn process(process: &ProcessStatus) -> DiagnosticStatus {
    let level = match process.activity {
        Activity::Waiting | Activity::Working | Activity::Running => OK,
        Activity::Starting => WARN,
        Activity::Silent | Activity::Ended => ERROR,
    };
    let name = format!("gyre: {}", process.name);
    let mut part = DiagnosticStatus::new(&name, level, process.activity.name().to_owned());
    part.values = vec![
        KeyValue::new("pid", process.pid),
        KeyValue::new("restarts", process.restarts),
        KeyValue::new("uptime_s", format!("{:.1}", process.uptime_s)),
    ];
    let death = process.last_death.as_ref();
    part.values
        .extend(death.map(|cause| KeyValue::new("last_death", cause)));
    let clock = process.received.and_then(|it| it.clock);
    part.values.extend(clock.iter().flat_map(|clock| {
        let seconds = |ns: i64| format!("{:.6}", ns as f64 * 1e-9);
        [
            KeyValue::new("radar_clock_offset_s", seconds(clock.offset_ns)),
            KeyValue::new("radar_clock_jitter_s", seconds(clock.jitter_ns)),
            KeyValue::new("radar_clock_steps", clock.steps),
        ]
    }));
    part
}

#[cfg(test)]
mod tests {
    use gyre_contract::control::{Received, SensorClock};

    use super::*;

    fn status(dropped: u64) -> Status {
        let process = |name: &str, activity| ProcessStatus {
            name: name.to_owned(),
            pid: 7,
            command: Vec::new(),
            is_swapped: false,
            activity,
            activity_s: None,
            uptime_s: 1.0,
            restarts: 2,
            last_death: Some("signal 9".to_owned()),
            missed: None,
            received: None,
        };
        Status {
            dropped,
            processes: vec![
                process("masking", Activity::Working),
                process("refinement", Activity::Silent),
            ],
            ..Status::default()
        }
    }

    #[test]
    fn levels_follow_the_run_and_its_processes() {
        let (mut before, mut state) = (LastCounts::default(), RunState::default());
        let mut levels = |state: &RunState, status| {
            let parts = array(state, status, &mut before).status;
            parts.iter().map(|part| part.level).collect::<Vec<_>>()
        };
        assert_eq!(levels(&state, None), [STALE]);
        // Drops from before the bridge began, or while the supervisor did not answer, do not count
        // as present drops.
        state.phase = RunPhase::Working;
        assert_eq!(levels(&state, Some(status(9))), [OK, OK, ERROR]);
        assert_eq!(levels(&state, None), [OK]);
        assert_eq!(levels(&state, Some(status(9))), [OK, OK, ERROR]);
        // The next run begins at zero.
        assert_eq!(levels(&state, Some(status(0))), [OK, OK, ERROR]);
        assert_eq!(levels(&state, Some(status(3))), [WARN, OK, ERROR]);
        assert_eq!(levels(&state, Some(status(3))), [OK, OK, ERROR]);
        state.unsent = 1;
        assert_eq!(levels(&state, Some(status(3))), [WARN, OK, ERROR]);
        state.phase = RunPhase::Ended;
        assert_eq!(levels(&state, None), [STALE]);
    }

    #[test]
    fn the_radar_has_its_clock_among_its_figures() {
        let mut source = status(0).processes.remove(0);
        let clock = SensorClock {
            offset_ns: -250_000_000,
            steps: 3,
            ..SensorClock::default()
        };
        source.received = Some(Received {
            clock: Some(clock),
            ..Received::default()
        });
        let values = process(&source).values;
        for (key, value) in [("offset_s", "-0.250000"), ("steps", "3")] {
            let expected = KeyValue::new(&format!("radar_clock_{key}"), value);
            assert!(values.contains(&expected), "{values:?}");
        }
    }
}
