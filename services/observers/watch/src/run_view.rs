//! The view of the run: written by the threads that observe it, read by browsers and Prometheus.

use std::{
    collections::VecDeque,
    sync::{Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use axum::extract::ws::Message;
use gyre_client::{Manifest, clock};
use gyre_contract::{
    Message as _, Objects, ObjectsHeader, Pose, PoseHeader, SampleRates, Scan, ScanHeader,
    WitnessCounts,
    control::{Phase, Status},
    flag,
};
use serde::Serialize;
use serde_json::json;
use tokio::sync::watch;

use crate::{
    delays,
    histograms::Histograms,
    messages::{self, HealthReport, Layer, RunCounts, RunInfo, RunState},
    pictures::PackedPoints,
    processes::Process,
    recent_drift::RecentDrift,
    track::{Cursor, Track, Vertex},
};

/// The number of motions for which the page shows the share of gyro, wheels and Doppler: ten
/// seconds at 4 Hz.
const LAST_MOTIONS: usize = 40;
/// The number of poses that are kept: a minute at 136 Hz.
const MAX_POSES: usize = 8192;

#[derive(Default)]
pub struct RunView {
    state: Mutex<ViewState>,
    /// The newest pictures and reports. A slow browser receives the newest, and not those between.
    pub updates: Updates,
    pub histograms: Histograms,
}

pub type Newest = watch::Sender<Option<Message>>;

#[derive(Default)]
pub struct Updates {
    pub run: Newest,
    pub health: Newest,
    pub layers: [Newest; 4],
    pub stop: watch::Sender<bool>,
}

impl Updates {
    pub fn of(&self, layer: Layer) -> &Newest {
        &self.layers[layer as usize]
    }
}

#[derive(Default)]
struct ViewState {
    run: RunInfo,
    track: Track,
    drift: RecentDrift,
    /// The last poses, the newest at the end.
    poses: VecDeque<PoseHeader>,
    counts: RunCounts,
    /// When the newest pose came.
    newest: Option<Instant>,
    rates: SampleRates,
    /// Points that wait for the pose of their scan.
    pending: Option<(u64, PackedPoints)>,
    reported: Option<(i64, u64)>,
    /// Why something is not shown.
    notice: Option<String>,
    status: Option<Status>,
    processes: Vec<Process>,
}

impl RunView {
    pub fn new(out: &str) -> Self {
        let view = Self::default();
        view.update_run(|run| out.clone_into(&mut run.out));
        view
    }

    fn state(&self) -> MutexGuard<'_, ViewState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn run(&self) -> RunInfo {
        self.state().run.clone()
    }

    pub fn begin(&self, manifest: &Manifest) {
        {
            let mut state = self.state();
            let mut track = std::mem::take(&mut state.track);
            track.clear();
            *state = ViewState {
                track,
                ..ViewState::default()
            };
        }
        for layer in &self.updates.layers {
            layer.send_replace(None);
        }
        self.update_run(|run| {
            run.id.clone_from(&manifest.prefix);
            run.out = manifest.out.display().to_string();
            run.build = manifest.build.chars().take(12).collect();
            run.state = RunState::Working;
            run.live = manifest.live;
            run.rate = manifest.rate;
            run.window = manifest.window.scans;
            run.objects = manifest.window.objects;
        });
    }

    pub fn end(&self, state: RunState) {
        {
            let mut state = self.state();
            state.counts.in_flight = 0;
            state.processes.iter_mut().for_each(Process::end);
        }
        self.set_state(state);
        self.report();
    }

    pub fn set_state(&self, state: RunState) {
        self.update_run(|run| run.state = state);
    }

    fn update_run(&self, change: impl FnOnce(&mut RunInfo)) {
        let mut state = self.state();
        change(&mut state.run);
        send_json(&self.updates.run, &state.run);
    }

    pub fn add_to_track(&self, pose: &PoseHeader) {
        let mut state = self.state();
        state.track.add(pose);
        state.drift.add(pose);
        if !pose.item.is(flag::BREAK) {
            let record = &pose.motion.refinement;
            state.counts.witnesses.add(record);
            if let Some(count) = state.counts.outcomes.get_mut(record.outcome as usize) {
                *count += 1;
            }
        }
    }

    /// Shows a pose, unless it was shown before: an observer that attaches again receives the last
    /// ones again.
    pub fn add_pose(&self, pose: &PoseHeader) {
        let mut state = self.state();
        let state = &mut *state;
        let has_pose = |latest: &PoseHeader| latest.item.seq >= pose.item.seq;
        if state.poses.back().is_some_and(has_pose) {
            return;
        }
        self.histograms.add(&pose.item);
        state.newest = Some(Instant::now());
        state.poses.push_back(*pose);
        if state.poses.len() > MAX_POSES {
            state.poses.pop_front();
        }
        state.counts.poses = pose.item.seq + 1;
        state.counts.dropped = pose.item.dropped();
        // The supervisor is asked once a second.
        let with_pose = state.counts.poses + state.counts.dropped;
        state.counts.published = state.counts.published.max(with_pose);
        let waits_for_this = |pending: &mut (u64, PackedPoints)| pending.0 == pose.item.seq;
        if let Some((_, points)) = state.pending.take_if(waits_for_this) {
            self.send_points(&points, pose);
        }
    }

    pub fn add_samples(&self, scan: &ScanHeader, bytes: &[u8]) {
        let mut state = self.state();
        state.rates.add(scan, bytes);
        state.counts.samples = state.rates.health();
    }

    /// Adds the points of a scan. They are sent with its pose, now or when it comes.
    pub fn add_points(&self, points: PackedPoints, seq: u64) {
        let mut state = self.state();
        match state.poses.iter().rev().find(|pose| pose.item.seq == seq) {
            Some(pose) => self.send_points(&points, pose),
            None => state.pending = Some((seq, points)),
        }
    }

    fn send_points(&self, points: &PackedPoints, pose: &PoseHeader) {
        let place = [pose.x_m, pose.y_m, pose.yaw_rad];
        if let Ok(message) = points.at(place, pose.item.seq) {
            let points = self.updates.of(Layer::Points);
            points.send_replace(Some(Message::Binary(message)));
        }
    }

    pub fn set_objects(&self, header: &ObjectsHeader) {
        send_json(self.updates.of(Layer::Objects), &messages::objects(header));
    }

    pub fn set_processes(&self, status: &Status, processes: Vec<Process>) {
        let mut state = self.state();
        let with_pose = status.poses + status.dropped;
        // A replaced source need not report its number of published scans.
        let published = status.published.unwrap_or_default().max(with_pose);
        // Poses that came since are counted already: a counter never decreases.
        state.counts.published = state.counts.published.max(published);
        state.counts.in_flight = published - with_pose;
        state.processes = processes;
        state.status = Some(status.clone());
    }

    /// Notes that no supervisor answers.
    pub fn set_unknown(&self) {
        self.state().status = None;
    }

    /// Returns what the supervisor has reported of the run last; `None` while no run answers.
    pub fn status(&self) -> Option<Status> {
        self.state().status.clone()
    }

    pub fn processes(&self) -> Vec<Process> {
        self.state().processes.clone()
    }

    pub fn add_missed(&self, topic: &str, missed: u64) {
        let mut state = self.state();
        let counts = &mut state.counts.missed;
        *match topic {
            Pose::TOPIC => &mut counts.pose,
            Scan::TOPIC => &mut counts.scan,
            Objects::TOPIC => &mut counts.objects,
            _ => &mut counts.masked,
        } += missed;
    }

    /// Sets the reason why something is not shown; `None`: all is.
    pub fn set_notice(&self, notice: Option<String>) {
        self.state().notice = notice;
    }

    pub fn counts(&self) -> RunCounts {
        let state = self.state();
        let is_working = state.run.state == RunState::Working;
        let newest = state.newest.filter(|_| is_working);
        let age = newest.map(|newest| newest.elapsed());
        RunCounts {
            pose_age_s: age.unwrap_or_default().as_secs_f64(),
            ..state.counts
        }
    }

    pub fn report(&self) {
        let now_ns = clock::now_ns();
        let mut state = self.state();
        let counts = state.counts;
        let reported = state.reported.replace((now_ns, counts.poses));
        let scans_per_s = reported.map_or(0.0, |(at_ns, poses)| {
            let elapsed_s = (now_ns - at_ns).max(1) as f64 * 1e-9;
            counts.poses.saturating_sub(poses) as f64 / elapsed_s
        });
        let health = HealthReport {
            counts,
            scans_per_s,
            distance_m: state.track.length_m(),
            delays: delays::report(state.poses.iter().map(|pose| &pose.item), now_ns),
            others: others(&state),
            notice: state.notice.clone().or_else(|| trouble(&state)),
            processes: state.processes.clone(),
        };
        send_json(&self.updates.health, &health);
    }

    /// Returns the message of new poses for a browser that has received those up to `last`; `None`
    /// if there are no new poses.
    pub fn poses(&self, cursor: &mut Cursor, last: &mut Option<u64>) -> Option<Message> {
        let state = self.state();
        let latest = state.poses.back();
        let seq = latest.map(|latest| latest.item.seq);
        let (vertices, replace) = state.track.since(cursor);
        if vertices.is_empty() && !replace && seq == *last {
            return None;
        }
        *last = seq;
        json(&json!({
            "kind": "poses",
            "replace": replace,
            "vertices": vertices,
            "pose": latest.map(messages::pose),
            "drift": state.drift.drift(),
        }))
    }

    /// Returns the trajectory: x, y (m), yaw (rad).
    pub fn trajectory(&self) -> Vec<[f64; 3]> {
        let state = self.state();
        let latest = state.poses.back().map(Vertex::of);
        let (vertices, _) = state.track.since(&mut Cursor::default());
        let vertices = vertices.iter().chain(&latest);
        let poses = vertices.map(|Vertex([x, y, yaw, ..])| [*x, *y, *yaw]);
        poses.collect()
    }

    /// Returns the time of the newest pose on the sensor's clock, ns.
    pub fn newest_stamp_ns(&self) -> Option<i64> {
        let state = self.state();
        state.poses.back().map(|latest| latest.item.stamp_ns)
    }

    pub fn is_wanted(&self, layer: Layer) -> bool {
        if layer == Layer::Objects && !self.state().run.objects {
            return false;
        }
        self.updates.of(layer).receiver_count() > 0
    }

    pub fn stop(&self) {
        self.updates.stop.send_replace(true);
    }

    pub fn is_stopping(&self) -> bool {
        *self.updates.stop.borrow()
    }
}

fn trouble(state: &ViewState) -> Option<String> {
    let status = state.status.as_ref()?;
    let waits = status.phase == Phase::WaitingForRadar;
    let phase = waits.then(|| status.phase.name().to_owned());
    status.notice.clone().or(phase)
}

fn others(state: &ViewState) -> Option<String> {
    let motions = state.poses.iter().rev();
    let motions = motions.filter(|pose| !pose.item.is(flag::BREAK));
    let motions = motions.map(|pose| &pose.motion.refinement);
    let used = WitnessCounts::of(motions.take(LAST_MOTIONS)).in_words();
    let samples = state.counts.samples.in_words();
    let words: Vec<String> = used.into_iter().chain(samples).collect();
    (!words.is_empty()).then(|| words.join("; "))
}

fn json(message: &impl Serialize) -> Option<Message> {
    let text = serde_json::to_string(message).ok()?;
    Some(Message::Text(text.into()))
}

fn send_json(channel: &Newest, message: &impl Serialize) {
    if let Some(message) = json(message) {
        channel.send_replace(Some(message));
    }
}

#[cfg(test)]
mod tests {
    use gyre_contract::{Item, MaskedHeader, Object, StageId};
    use gyre_geometry::SparsePoint;
    use serde_json::Value;

    use super::*;
    use crate::pictures;

    fn pose(seq: u64) -> PoseHeader {
        let mut item = Item::numbered(seq);
        item.hop_mut(StageId::PoseIntegration).finished_ns = clock::now_ns();
        PoseHeader {
            item,
            x_m: seq as f64,
            ..PoseHeader::default()
        }
    }

    fn points() -> PackedPoints {
        let point = SparsePoint {
            weight: 1.0,
            ..SparsePoint::default()
        };
        pictures::points(&[point], &MaskedHeader::default())
    }

    fn parsed(message: &Message) -> Value {
        serde_json::from_str(message.to_text().unwrap()).unwrap()
    }

    fn newest(channel: &Newest) -> Value {
        parsed(channel.borrow().as_ref().unwrap())
    }

    #[test]
    fn points_are_sent_with_the_pose_of_their_scan_whichever_comes_first() {
        let view = RunView::new("out");
        let sent = || {
            let message = view.updates.of(Layer::Points).borrow().clone()?;
            let (header, _) = pictures::decode(&message.into_data())?;
            header["pose"][0].as_f64()
        };
        view.add_pose(&pose(3));
        view.add_points(points(), 4);
        assert_eq!(sent(), None);
        view.add_pose(&pose(4));
        assert_eq!(sent(), Some(4.0));
        view.add_points(points(), 3);
        assert_eq!(sent(), Some(3.0));
    }

    #[test]
    fn the_poses_that_are_kept_are_bounded() {
        let view = RunView::new("out");
        (0..10_000).for_each(|seq| view.add_pose(&pose(seq)));
        assert_eq!(view.state().poses.len(), MAX_POSES);
    }

    #[test]
    fn a_browser_receives_what_is_new_and_nothing_twice() {
        let view = RunView::new("out");
        let (mut cursor, mut last) = (Cursor::default(), None);
        let mut next = || -> Option<Value> {
            let message = view.poses(&mut cursor, &mut last)?;
            Some(parsed(&message))
        };
        let first = next().unwrap();
        assert_eq!(first["kind"], "poses");
        assert_eq!(first["pose"], Value::Null);
        assert_eq!(next(), None);
        view.add_to_track(&pose(0));
        view.add_to_track(&pose(1));
        view.add_pose(&pose(1));
        let second = next().unwrap();
        assert_eq!(second["vertices"].as_array().unwrap().len(), 2);
        assert_eq!(second["replace"], false);
        assert_eq!(second["pose"]["seq"], 1);
        assert_eq!(next(), None);
    }

    #[test]
    fn objects_are_wanted_of_a_run_that_has_them_and_have_places_velocities_and_sizes() {
        let view = RunView::new("out");
        let _browser = view.updates.of(Layer::Objects).subscribe();
        assert!(!view.is_wanted(Layer::Objects));
        view.update_run(|run| run.objects = true);
        assert!(view.is_wanted(Layer::Objects));
        let mut header = ObjectsHeader {
            x_m: 7.0,
            objects: 1,
            listed: 1,
            ..ObjectsHeader::default()
        };
        header.list[0] = Object {
            id: 5,
            x_m: 20.0,
            vy_mps: -3.0,
            length_m: 4.4,
            moving: 1,
            ..Object::default()
        };
        view.set_objects(&header);
        let sent = newest(view.updates.of(Layer::Objects));
        let expected = serde_json::json!({
            "kind": "objects", "seq": 0, "pose": [7.0, 0.0, 0.0], "count": 1,
            "objects": [{
                "id": 5, "pose": [20.0, 0.0, 0.0], "velocity": [0.0, -3.0], "size": [4.4, 0.0],
                "moving": true,
            }],
        });
        assert_eq!(sent, expected);
    }

    #[test]
    fn reports_have_counts_delays_and_processes_at_one_level() {
        let view = RunView::new("out");
        view.add_pose(&pose(6));
        view.report();
        let health = newest(&view.updates.health);
        assert_eq!(health["kind"], "health");
        assert_eq!(health["poses"], 7);
        assert_eq!(health["delays"]["samples"], 1);
        assert_eq!(health["processes"], serde_json::json!([]));
    }
}
