//! The tracker: the whole method on one page.

use std::path::Path;

use gyre_contract::Object;
use gyre_geometry::SparsePoint;
use gyre_masking::networks::PlanesError;

use crate::PlacedScan;
use crate::assignment::assign;
use crate::detector::{Detection, Detector};
use crate::track::Track;

/// A place counts as part of a moving vehicle from this likelihood of the network on: a less likely
/// place keeps no track alive.
const LEAST_LIKELY: f64 = 0.1;
/// Time between two scans beyond which all tracks end, s: by then a car at walking pace is
/// elsewhere.
const MAX_GAP_S: f64 = 2.0;

pub struct ObjectTracker {
    detector: Detector,
    tracks: Vec<Track>,
    objects: Vec<Object>,
    next_id: u64,
    stamp_ns: Option<i64>,
}

impl ObjectTracker {
    /// Creates a tracker without objects. The ONNX Runtime at a path computes its network, or else
    /// rten, which takes several times as long.
    pub fn new(runtime: Option<&Path>) -> Result<Self, PlanesError> {
        Ok(Self {
            detector: Detector::new(runtime)?,
            tracks: Vec::new(),
            objects: Vec::new(),
            next_id: 1,
            stamp_ns: None,
        })
    }

    /// Takes the points of the next scan, as measured. Returns the objects at its time: those that
    /// move, and those that did and stand now. A scan that is not later than the one before, or
    /// later by more than 2 s, ends all tracks.
    pub fn update(
        &mut self,
        scan: &PlacedScan,
        points: &[SparsePoint],
    ) -> Result<&[Object], PlanesError> {
        self.predict(scan.stamp_ns);
        let found = self.detector.detect(scan, points, LEAST_LIKELY)?;
        let rest = self.assign(found);
        let begun = rest.iter().map(Track::new);
        self.tracks.extend(begun);
        self.judge();
        let objects = self.tracks.iter().filter_map(Track::object);
        self.objects.clear();
        self.objects.extend(objects);
        Ok(&self.objects)
    }

    /// Ends all tracks: the poses of the next scans are not continued from the last ones.
    /// Identities are not given again.
    pub fn end_tracks(&mut self) {
        self.detector.clear();
        self.tracks.clear();
    }

    fn predict(&mut self, stamp_ns: i64) {
        if let Some(before_ns) = self.stamp_ns {
            let dt_s = stamp_ns.saturating_sub(before_ns) as f64 * 1e-9;
            match dt_s > 0.0 && dt_s <= MAX_GAP_S {
                true => self.tracks.iter_mut().for_each(|track| track.predict(dt_s)),
                false => self.end_tracks(),
            }
        }
        self.stamp_ns = Some(stamp_ns);
    }

    /// Updates the tracks with the detections of the scan, objects first. Returns the remaining
    /// detections.
    fn assign(&mut self, found: Vec<Detection>) -> Vec<Detection> {
        let (objects, others): (Vec<usize>, Vec<usize>) = (0..self.tracks.len())
            .filter(|index| !self.tracks[*index].lost)
            .partition(|index| self.tracks[*index].is_object());
        let rest = self.assign_to(&objects, found);
        self.assign_to(&others, rest)
    }

    fn assign_to(&mut self, tracks: &[usize], found: Vec<Detection>) -> Vec<Detection> {
        let costs: Vec<Vec<Option<f64>>> = tracks
            .iter()
            .map(|track| {
                let track = &self.tracks[*track];
                let costs = found.iter().map(|it| track.cost(it));
                costs.collect()
            })
            .collect();
        let mut is_left = vec![true; found.len()];
        for (track, assigned) in tracks.iter().zip(assign(&costs)) {
            let track = &mut self.tracks[*track];
            match assigned {
                Some(detection) => {
                    is_left[detection] = false;
                    track.update(&found[detection]);
                }
                None => track.miss(),
            }
        }
        let left = found.into_iter().zip(is_left);
        left.filter_map(|(detection, is_left)| is_left.then_some(detection))
            .collect()
    }

    /// Ends tracks, including later tracks of the same vehicle, and decides which move. An object
    /// keeps its identity: two close vehicles may have been confused.
    fn judge(&mut self) {
        // Objects first, then the older ones.
        self.tracks.sort_by_key(|track| !track.is_object());
        for index in 0..self.tracks.len() {
            let (first, rest) = self.tracks.split_at_mut(index);
            let is_known = |first: &Track| !first.lost && first.is_same(&rest[0]);
            if !rest[0].lost && first.iter().any(is_known) {
                rest[0].lose();
            }
        }
        self.tracks.retain(|track| !track.is_over());
        for index in 0..self.tracks.len() {
            if self.tracks[index].judge() {
                self.confirm(index);
            }
        }
    }

    fn confirm(&mut self, index: usize) {
        let mut found = self.tracks.remove(index);
        let lost = self.tracks.iter().enumerate();
        let lost = lost.filter_map(|(at, it)| Some((at, it.distance(&found)?)));
        match lost.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((lost, _)) => found.take_over(&mut self.tracks[lost]),
            None => {
                found.id = Some(self.next_id);
                self.next_id += 1;
            }
        }
        self.tracks.insert(index, found);
    }
}
