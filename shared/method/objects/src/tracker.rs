//! The tracker: the whole method on one page.

use gyre_geometry::SparsePoint;
use nalgebra::{Matrix2, Point2, Vector2};

use crate::assignment::assign;
use crate::clusters::{Measurement, Members, clusters};
use crate::evidence::Evidence;
use crate::returns::{PlacedScan, Return, place};
use crate::track::Track;
use crate::{Object, ObjectsConfig, ObjectsError};

/// Chi-square of two degrees of freedom that one cluster in a thousand of its own track exceeds.
const GATE: f64 = 13.8;
/// Share of the last scans with something at a place from which on a return there stands, and
/// belongs to no object. Where an object is expected, more is taken for new than elsewhere.
const OWN_SHARE: f64 = 0.7;
/// Time between two scans beyond which all tracks end, s.
const MAX_GAP_S: f64 = 2.0;

/// Tracks moving objects from scan to scan.
#[derive(Clone, Debug)]
pub struct ObjectTracker {
    config: ObjectsConfig,
    evidence: Evidence,
    returns: Vec<Return>,
    tracks: Vec<Track>,
    objects: Vec<Object>,
    next_id: u64,
    stamp_ns: Option<i64>,
}

impl ObjectTracker {
    /// Creates a tracker without objects.
    ///
    /// # Errors
    /// The first setting out of its bounds.
    pub fn new(config: &ObjectsConfig) -> Result<Self, ObjectsError> {
        config.validate()?;
        Ok(Self {
            evidence: Evidence::new(
                config.memory_scans,
                config.max_range_m,
                config.bearing_sigma_deg.to_radians(),
            ),
            config: config.clone(),
            returns: Vec::new(),
            tracks: Vec::new(),
            objects: Vec::new(),
            next_id: 1,
            stamp_ns: None,
        })
    }

    /// Takes the points of the next scan, as measured. Returns the objects at its time: those that
    /// move, and those that did and stand now.
    ///
    /// A scan that is not later than the one before, or by more than two seconds, ends all tracks.
    pub fn update(&mut self, scan: &PlacedScan, points: &[SparsePoint]) -> &[Object] {
        self.predict(scan.stamp_ns);
        let limits = (self.config.max_range_m, self.config.contrast);
        place(scan, points, limits, &mut self.returns);
        self.compare();
        let claims = self.claim();
        let fresh = self.fresh(&claims);
        let found = clusters(&self.returns, &fresh);
        let own = self.own_clusters(&claims);
        let rest = self.assign(&own, &found);
        self.begin(scan, &found, &rest);
        self.remember(scan, &claims);
        self.judge();
        self.objects.clear();
        self.objects
            .extend(self.tracks.iter().filter_map(Track::object));
        &self.objects
    }

    /// Forgets all objects and all that was seen; identities are not given again.
    pub fn restart(&mut self) {
        self.evidence.clear();
        self.tracks.clear();
        self.objects.clear();
        self.stamp_ns = None;
    }

    /// Predicts all tracks at the scan's time.
    fn predict(&mut self, stamp_ns: i64) {
        if let Some(before_ns) = self.stamp_ns {
            let dt_s = stamp_ns.saturating_sub(before_ns) as f64 * 1e-9;
            match dt_s > 0.0 && dt_s <= MAX_GAP_S {
                true => {
                    let config = &self.config;
                    self.tracks
                        .iter_mut()
                        .for_each(|track| track.predict(dt_s, config));
                }
                false => self.restart(),
            }
        }
        self.stamp_ns = Some(stamp_ns);
    }

    /// Compares the returns with what the last scans saw where they are.
    fn compare(&mut self) {
        for found in &mut self.returns {
            found.share = self.evidence.history(found).share();
        }
    }

    /// Returns for each return the track of the moving object whose it is. What stands for most of
    /// the time is nobody's.
    fn claim(&self) -> Vec<Option<usize>> {
        let moving: Vec<(usize, &Track)> = self
            .tracks
            .iter()
            .enumerate()
            .filter(|(_, track)| track.is_moving())
            .collect();
        let claim = |found: &Return| {
            if !found.stands_out || found.share >= OWN_SHARE {
                return None;
            }
            let distances = moving
                .iter()
                .map(|(index, track)| (*index, track.distance(found)));
            let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
            nearest
                .filter(|(_, distance)| *distance <= 1.0)
                .map(|(index, _)| index)
        };
        self.returns.iter().map(claim).collect()
    }

    /// Returns what nobody claims and was free before.
    fn fresh(&self, claims: &[Option<usize>]) -> Vec<u32> {
        let is_fresh = |index: &u32| {
            let index = *index as usize;
            claims[index].is_none()
                && self.returns[index].stands_out
                && self.returns[index].share < self.config.standing_share
        };
        (0..self.returns.len() as u32).filter(is_fresh).collect()
    }

    /// Returns the claimed returns of each track.
    fn own_clusters(&self, claims: &[Option<usize>]) -> Vec<Members> {
        let mut own = vec![Members::new(); self.tracks.len()];
        for (index, claim) in claims.iter().enumerate() {
            if let Some(track) = claim {
                own[*track].push(index as u32);
            }
        }
        own
    }

    /// Updates the tracks by their own returns, and those without by the nearest clusters. Returns
    /// the clusters that are left.
    fn assign(&mut self, own: &[Members], found: &[Members]) -> Vec<usize> {
        let mut costs = Vec::new();
        let mut seekers = Vec::new();
        let measured: Vec<Measurement> = found
            .iter()
            .map(|members| Measurement::of(&self.returns, members))
            .collect();
        for (index, members) in own.iter().enumerate() {
            if members.is_empty() {
                seekers.push(index);
                costs.push(self.costs(&self.tracks[index], found, &measured));
            } else {
                let measured = Measurement::of(&self.returns, members);
                let noise = self.noise(&measured, true);
                self.tracks[index].update(&self.returns, members, &measured, &noise);
            }
        }
        let assigned = assign(&costs);
        let mut is_left = vec![true; found.len()];
        for (track, cluster) in seekers.into_iter().zip(assigned) {
            let Some(cluster) = cluster else { continue };
            is_left[cluster] = false;
            let noise = self.noise(&measured[cluster], self.tracks[track].is_confirmed());
            self.tracks[track].update(&self.returns, &found[cluster], &measured[cluster], &noise);
        }
        (0..found.len())
            .filter(|cluster| is_left[*cluster])
            .collect()
    }

    /// The cost of each cluster for a track; `None` outside of its gate.
    fn costs(
        &self,
        track: &Track,
        found: &[Members],
        measured: &[Measurement],
    ) -> Vec<Option<f64>> {
        let cost = |(members, measured): (&Members, &Measurement)| {
            if measured.weight < NEGLIGIBLE_WEIGHT {
                return None;
            }
            let at = match track.has_heading() {
                true => track.measured_centre(&self.returns, members, measured),
                false => measured.at,
            };
            let innovation =
                track
                    .filter
                    .innovation(measured, &at, &self.noise(measured, track.is_confirmed()));
            (innovation.chi_square() <= GATE).then(|| innovation.cost())
        };
        found.iter().zip(measured).map(cost).collect()
    }

    /// Returns whether a cluster can begin a track.
    fn is_strong(&self, measured: &Measurement) -> bool {
        measured.returns >= self.config.min_returns
            && measured.weight >= self.config.min_weight
            && measured.range_m >= self.config.min_range_m
    }

    /// The covariance of a cluster's position, m².
    fn noise(&self, measured: &Measurement, known: bool) -> Matrix2<f64> {
        let along = measured.direction;
        let across = Vector2::new(-along.y, along.x);
        let bearing_m = self.config.bearing_sigma_deg.to_radians() * measured.range_m;
        let range =
            self.config.range_sigma_m.powi(2) + if known { 0.0 } else { UNKNOWN_CENTRE_M.powi(2) };
        // Across as along there are scatterers that come and go.
        along * along.transpose() * range
            + across * across.transpose() * (range + bearing_m.powi(2))
    }

    /// Begins tracks at the clusters that belong to none, but for mirror images: those behind what
    /// stands.
    fn begin(&mut self, scan: &PlacedScan, found: &[Members], rest: &[usize]) {
        let sensor = Point2::from(scan.pose.translation.vector);
        for members in rest.iter().map(|cluster| &found[*cluster]) {
            let measured = Measurement::of(&self.returns, members);
            if !self.is_strong(&measured) {
                continue;
            }
            if self.evidence.is_behind_standing(&sensor, &measured.at) {
                continue;
            }
            let noise = self.noise(&measured, false);
            let mut track = Track::new(&measured, &noise, &self.config);
            track.leave(&self.returns, members);
            self.tracks.push(track);
        }
    }

    /// Ends tracks, joins those that have become one, and decides which move.
    fn judge(&mut self) {
        let config = &self.config;
        self.tracks.retain(|track| !track.is_over(config));
        for track in &mut self.tracks {
            track.look_back(&self.evidence);
            if track.judge(&self.config) {
                track.confirm(self.next_id);
                self.next_id += 1;
            }
        }
        self.join();
    }

    /// Ends each track whose centre lies in the outline of an older object.
    fn join(&mut self) {
        let mut index = 0;
        while index < self.tracks.len() {
            let (older, rest) = self.tracks.split_at(index);
            let is_within = |older: &Track| older.is_confirmed() && older.is_same(&rest[0]);
            match older.iter().any(is_within) {
                true => _ = self.tracks.remove(index),
                false => index += 1,
            }
        }
    }

    /// Adds the scan to what was seen, but for moving objects.
    fn remember(&mut self, scan: &PlacedScan, claims: &[Option<usize>]) {
        let sensor = Point2::from(scan.pose.translation.vector);
        let stands = |index: usize| claims[index].is_none();
        self.evidence.add(sensor, &self.returns, stands);
    }
}

/// Weight below which a cluster counts for nothing.
const NEGLIGIBLE_WEIGHT: f64 = 0.1;
/// Standard deviation of the centre of an object whose outline is not known yet, m: half of a car.
const UNKNOWN_CENTRE_M: f64 = 1.0;
