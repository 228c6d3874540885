//! What is known of the run: the threads that observe it write here, and browsers and Prometheus read.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use axum::{body::Bytes, extract::ws::Utf8Bytes};
use gyre_messages::PoseHeader;
use gyre_stage::{Manifest, clock, control::Status};
use serde::Serialize;
use tokio::sync::watch;

use crate::{
    delays::Delays,
    histograms::Histograms,
    messages::{Counts, Current, Health, Layer, Missed, Poses, Run, RunState},
    pictures::Points,
    processes::Process,
    traces,
    track::{Cursor, Track, Vertex},
};

/// Poses that are kept to find that of a scan whose points come later.
const RECENT: usize = 256;

/// What is known of the run.
pub struct Board {
    known: Mutex<Known>,
    /// The newest pictures and reports. One who is slow receives the newest, and not those between.
    pub news: News,
    /// Browsers that want each layer.
    wanted: [AtomicUsize; 3],
    /// Delays of all poses.
    pub histograms: Histograms,
    /// The traces, where they are sent.
    pub traces: OnceLock<Arc<traces::Counts>>,
}

/// The newest of each kind of message to a browser.
pub struct News {
    /// The run.
    pub run: watch::Sender<Utf8Bytes>,
    /// Counts and delays.
    pub health: watch::Sender<Utf8Bytes>,
    /// The newest scan.
    pub scan: watch::Sender<Bytes>,
    /// The newest raster.
    pub raster: watch::Sender<Bytes>,
    /// The newest points.
    pub points: watch::Sender<Bytes>,
    /// True when the program ends.
    pub stop: watch::Sender<bool>,
}

#[derive(Default)]
struct Known {
    run: Run,
    track: Track,
    delays: Delays,
    latest: Option<Current>,
    counts: Counts,
    /// The numbers and poses of the last scans.
    recent: VecDeque<(u64, [f64; 3])>,
    /// Points that wait for the pose of their scan.
    pending: Option<(u64, Points)>,
    /// Time and number of poses at the last report.
    reported: Option<(i64, u64)>,
    notice: Option<String>,
    processes: Vec<Process>,
}

impl Board {
    /// An empty one, for the run that writes to `out`.
    pub fn new(out: &str) -> Self {
        let board = Self {
            known: Mutex::default(),
            news: News {
                run: watch::Sender::default(),
                health: watch::Sender::default(),
                scan: watch::Sender::default(),
                raster: watch::Sender::default(),
                points: watch::Sender::default(),
                stop: watch::Sender::new(false),
            },
            wanted: Default::default(),
            histograms: Histograms::default(),
            traces: OnceLock::new(),
        };
        board.introduce(|run| out.clone_into(&mut run.out));
        board
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the run.
    pub fn run(&self) -> Run {
        self.known().run.clone()
    }

    /// Begins with a run: all that was known is of an earlier one.
    pub fn begin(&self, manifest: &Manifest) {
        {
            let mut known = self.known();
            let mut track = std::mem::take(&mut known.track);
            track.clear();
            *known = Known {
                track,
                ..Known::default()
            };
        }
        for layer in [Layer::Scan, Layer::Raster, Layer::Points] {
            self.clear_pictures(layer);
        }
        self.introduce(|run| {
            run.id.clone_from(&manifest.prefix);
            run.out = manifest.out.display().to_string();
            run.state = RunState::Working;
            run.live = manifest.live;
            run.rate = manifest.rate;
            run.window = manifest.window.scans;
        });
    }

    /// Forgets the newest picture of a layer, so that one who comes later is not shown an old one.
    pub fn clear_pictures(&self, layer: Layer) {
        let pictures = match layer {
            Layer::Scan => &self.news.scan,
            Layer::Raster => &self.news.raster,
            Layer::Points => &self.news.points,
        };
        pictures.send_replace(Bytes::new());
    }

    /// The run has ended, and its processes with it.
    pub fn end(&self, state: RunState) {
        {
            let mut known = self.known();
            known.counts.in_flight = 0;
            known.processes.iter_mut().for_each(Process::end);
        }
        self.set_state(state);
        self.report();
    }

    /// Forgets the trajectory, which is about to be read from the journal.
    pub fn clear_track(&self) {
        self.known().track.clear();
    }

    /// Changes the state of the run.
    pub fn set_state(&self, state: RunState) {
        self.introduce(|run| run.state = state);
    }

    fn introduce(&self, change: impl FnOnce(&mut Run)) {
        let mut known = self.known();
        change(&mut known.run);
        known.run.version = env!("CARGO_PKG_VERSION");
        send_json(&self.news.run, &known.run);
    }

    /// Adds a pose of the journal: it was before this program looked.
    pub fn add_earlier(&self, pose: &PoseHeader) {
        self.known().track.add(pose);
    }

    /// Adds a pose, if it was not added before: an observer that comes again receives the last ones again. `is_new` is false for one that
    /// was in the journal.
    pub fn add_pose(&self, pose: &PoseHeader, is_new: bool) {
        let mut known = self.known();
        let known = &mut *known;
        let has_had = |latest: Current| latest.seq >= pose.item.seq;
        if known.latest.is_some_and(has_had) {
            return;
        }
        self.histograms.add(&pose.item);
        if is_new {
            known.track.add(pose);
        }
        known.delays.add(&pose.item);
        known.latest = Some(Current::of(pose));
        known.counts.poses = pose.item.seq + 1;
        known.counts.dropped = pose.item.dropped();
        // The supervisor is asked once a second.
        let with_pose = known.counts.poses + known.counts.dropped;
        known.counts.published = known.counts.published.max(with_pose);
        let (seq, place) = (pose.item.seq, [pose.x_m, pose.y_m, pose.yaw_rad]);
        known.recent.push_back((seq, place));
        if known.recent.len() > RECENT {
            known.recent.pop_front();
        }
        let waits_for_this = |pending: &mut (u64, Points)| pending.0 == seq;
        if let Some((_, points)) = known.pending.take_if(waits_for_this) {
            self.send_points(&points, place, seq);
        }
    }

    /// Adds the points of a scan. They are sent with its pose, now or when it comes.
    pub fn add_points(&self, points: Points, seq: u64) {
        let mut known = self.known();
        match known.recent.iter().rev().find(|(of, _)| *of == seq) {
            Some((_, place)) => self.send_points(&points, *place, seq),
            None => known.pending = Some((seq, points)),
        }
    }

    fn send_points(&self, points: &Points, place: [f64; 3], seq: u64) {
        if let Ok(message) = points.at(place, seq) {
            self.news.points.send_replace(message);
        }
    }

    /// Sets what the supervisor says of the run, and its processes.
    pub fn set_processes(&self, status: &Status, processes: Vec<Process>) {
        let mut known = self.known();
        let with_pose = status.poses + status.dropped;
        // A replaced source need not say what it has published.
        let published = status.published.unwrap_or_default().max(with_pose);
        // Poses that came since are counted already: a counter never decreases.
        known.counts.published = known.counts.published.max(published);
        known.counts.in_flight = published - with_pose;
        known.processes = processes;
    }

    /// Returns the processes.
    pub fn processes(&self) -> Vec<Process> {
        self.known().processes.clone()
    }

    /// Changes what was missed.
    pub fn set_missed(&self, change: impl FnOnce(&mut Missed)) {
        change(&mut self.known().counts.missed);
    }

    /// Says why something is not shown; `None`: all is.
    pub fn set_notice(&self, notice: Option<String>) {
        self.known().notice = notice;
    }

    /// Returns the counts.
    pub fn counts(&self) -> Counts {
        self.known().counts
    }

    /// Sends the report of this second.
    pub fn report(&self) {
        let now_ns = clock::now_ns();
        let mut known = self.known();
        let counts = known.counts;
        let reported = known.reported.replace((now_ns, counts.poses));
        let scans_per_s = reported.map_or(0.0, |(at_ns, poses)| {
            let elapsed_s = (now_ns - at_ns).max(1) as f64 * 1e-9;
            counts.poses.saturating_sub(poses) as f64 / elapsed_s
        });
        let health = Health {
            counts,
            scans_per_s,
            distance_m: known.track.length_m(),
            delays: known.delays.report(now_ns),
            notice: known.notice.clone(),
            processes: known.processes.clone(),
        };
        send_json(&self.news.health, &health);
    }

    /// Returns the message of poses for a browser; `None` if it has had all of them.
    pub fn poses(&self, cursor: &mut Cursor, had: &mut Option<u64>) -> Option<Utf8Bytes> {
        let known = self.known();
        let seq = known.latest.map(|latest| latest.seq);
        let (vertices, replace) = known.track.since(cursor);
        if vertices.is_empty() && !replace && seq == *had {
            return None;
        }
        *had = seq;
        let poses = Poses {
            replace,
            vertices,
            pose: known.latest,
        };
        serde_json::to_string(&poses).ok().map(Utf8Bytes::from)
    }

    /// Returns the places of the trajectory: x, y (m), yaw (rad).
    pub fn places(&self) -> Vec<[f64; 3]> {
        let known = self.known();
        let latest = known.latest.map(|latest| latest.vertex);
        let (vertices, _) = known.track.since(&mut Cursor::default());
        let vertices = vertices.iter().chain(&latest);
        vertices
            .map(|Vertex([x, y, yaw, ..])| [*x, *y, *yaw])
            .collect()
    }

    /// Returns the time of the newest pose on the sensor's clock, ns.
    pub fn newest_stamp_ns(&self) -> Option<i64> {
        self.known().latest.map(|latest| latest.stamp_ns)
    }

    /// Counts one more or one less browser that wants a layer.
    pub fn want(&self, layer: Layer, more: bool) {
        let wanted = &self.wanted[layer as usize];
        match more {
            true => wanted.fetch_add(1, Ordering::Relaxed),
            false => wanted.fetch_sub(1, Ordering::Relaxed),
        };
    }

    /// Returns whether a browser wants a layer.
    pub fn is_wanted(&self, layer: Layer) -> bool {
        self.wanted[layer as usize].load(Ordering::Relaxed) > 0
    }

    /// Ends all threads and connections.
    pub fn stop(&self) {
        self.news.stop.send_replace(true);
    }

    /// Returns whether the program ends.
    pub fn is_stopping(&self) -> bool {
        *self.news.stop.borrow()
    }
}

fn send_json(channel: &watch::Sender<Utf8Bytes>, message: &impl Serialize) {
    if let Ok(text) = serde_json::to_string(message) {
        channel.send_replace(text.into());
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_geometry::SparsePoint;
    use gyre_messages::{Item, MaskedHeader, StageId};
    use serde_json::Value;

    use super::*;
    use crate::{frame, pictures};

    fn pose(seq: u64) -> PoseHeader {
        let mut item = Item {
            seq,
            ..Item::default()
        };
        item.hop_mut(StageId::PoseIntegration).finished_ns = clock::now_ns();
        PoseHeader {
            item,
            x_m: seq as f64,
            ..PoseHeader::default()
        }
    }

    fn points() -> Points {
        let point = SparsePoint {
            weight: 1.0,
            ..SparsePoint::default()
        };
        pictures::points(&[point], &MaskedHeader::default())
    }

    #[test]
    fn points_are_sent_with_the_pose_of_their_scan_whichever_comes_first() {
        let board = Board::new("out");
        let sent = || {
            let message = board.news.points.borrow().clone();
            frame::decode(&message).map(|(header, _)| header["pose"][0].as_f64())
        };
        board.add_pose(&pose(3), true);
        board.add_points(points(), 4);
        assert_eq!(sent(), None);
        board.add_pose(&pose(4), true);
        assert_eq!(sent(), Some(Some(4.0)));
        board.add_points(points(), 3);
        assert_eq!(sent(), Some(Some(3.0)));
    }

    #[test]
    fn a_browser_receives_what_is_new_and_nothing_twice() {
        let board = Board::new("out");
        let (mut cursor, mut had) = (Cursor::default(), None);
        let mut next = || -> Option<Value> {
            let message = board.poses(&mut cursor, &mut had)?;
            Some(serde_json::from_str(&message).unwrap())
        };
        let first = next().unwrap();
        assert_eq!(
            (&first["kind"], &first["pose"]),
            (&"poses".into(), &Value::Null)
        );
        assert_eq!(next(), None);
        board.add_earlier(&pose(0));
        board.add_pose(&pose(1), true);
        let second = next().unwrap();
        assert_eq!(second["vertices"].as_array().unwrap().len(), 2);
        assert_eq!(
            (&second["replace"], &second["pose"]["seq"]),
            (&false.into(), &1.into())
        );
        assert_eq!(next(), None);
    }

    #[test]
    fn reports_have_counts_delays_and_processes_at_one_level() {
        let board = Board::new("out");
        board.add_pose(&pose(6), true);
        board.report();
        let health: Value = serde_json::from_str(&board.news.health.borrow()).unwrap();
        assert_eq!(
            (&health["kind"], &health["poses"]),
            (&"health".into(), &7.into())
        );
        assert_eq!(health["delays"]["samples"], 1);
        assert_eq!(health["processes"], serde_json::json!([]));
    }
}
