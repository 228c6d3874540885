//! The tracker: the whole method on one page.

use gyre_geometry::SparsePoint;
use nalgebra::{Matrix2, Point2};

use crate::assignment::assign;
use crate::clusters::{Cluster, Measurement, Members, clusters};
use crate::evidence::Evidence;
use crate::returns::{PlacedScan, Resolution, Return, place};
use crate::track::Track;
use crate::{Object, ObjectsConfig, ObjectsError};

/// Weight below which a cluster counts for nothing.
const NEGLIGIBLE_WEIGHT: f64 = 0.1;

/// Tracks moving objects from scan to scan.
#[derive(Clone, Debug)]
pub struct ObjectTracker {
    config: ObjectsConfig,
    evidence: Evidence,
    resolution: Resolution,
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
            evidence: Evidence::new(config.memory_scans, config.max_range_m),
            config: config.clone(),
            resolution: Resolution::default(),
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
        self.place(scan, points);
        self.compare();
        let claims = self.claim();
        let fresh = self.fresh(&claims);
        let found = clusters(&self.returns, &fresh, &self.config);
        let own = self.own_clusters(&claims);
        let rest = self.assign(&own, &found);
        self.begin(scan, &rest);
        self.remember(scan, &claims);
        self.judge();
        let objects = self.tracks.iter().filter_map(|it| it.object(&self.config));
        self.objects.clear();
        self.objects.extend(objects);
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
            match dt_s > 0.0 && dt_s <= self.config.max_gap_s {
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

    /// Places the points of the scan, and measures in which steps they are.
    fn place(&mut self, scan: &PlacedScan, points: &[SparsePoint]) {
        let limits = (self.config.max_range_m, self.config.contrast);
        place(scan, points, limits, &mut self.returns);
        if let Some(resolution) = Resolution::of(points) {
            self.resolution = resolution;
        }
    }

    /// Compares the returns with what the last scans saw where they are.
    fn compare(&mut self) {
        let bearing_sigma_rad = self.resolution.bearing_sigma_rad();
        for found in &mut self.returns {
            found.share = self.evidence.history(found, bearing_sigma_rad).share();
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
            if !found.stands_out || found.share >= self.config.own_share {
                return None;
            }
            let distances = moving
                .iter()
                .map(|(index, track)| (*index, track.distance(found, &self.config)));
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

    /// Returns the claimed returns of each track, if it has any.
    fn own_clusters(&self, claims: &[Option<usize>]) -> Vec<Option<Cluster>> {
        let mut own = vec![Members::new(); self.tracks.len()];
        for (index, claim) in claims.iter().enumerate() {
            if let Some(track) = claim {
                own[*track].push(index as u32);
            }
        }
        own.into_iter()
            .map(|members| Cluster::of(&self.returns, members, &self.config))
            .collect()
    }

    /// Updates the tracks by their own returns, and those without by the nearest clusters. Returns
    /// the clusters that are left.
    fn assign<'a>(&mut self, own: &[Option<Cluster>], found: &'a [Cluster]) -> Vec<&'a Cluster> {
        let mut costs = Vec::new();
        let mut seekers = Vec::new();
        for (index, own) in own.iter().enumerate() {
            match own {
                Some(cluster) => self.update_track(index, cluster),
                None => {
                    seekers.push(index);
                    costs.push(self.costs(&self.tracks[index], found));
                }
            }
        }
        let assigned = assign(&costs);
        let mut is_left = vec![true; found.len()];
        for (track, cluster) in seekers.into_iter().zip(assigned) {
            if let Some(cluster) = cluster {
                is_left[cluster] = false;
                self.update_track(track, &found[cluster]);
            }
        }
        let left = found.iter().zip(is_left);
        left.filter_map(|(cluster, is_left)| is_left.then_some(cluster))
            .collect()
    }

    fn update_track(&mut self, index: usize, cluster: &Cluster) {
        let noise = self.noise(&cluster.measured, self.tracks[index].is_box());
        self.tracks[index].update(&self.returns, cluster, &noise, &self.config);
    }

    /// The cost of each cluster for a track; `None` outside of its gate.
    fn costs(&self, track: &Track, found: &[Cluster]) -> Vec<Option<f64>> {
        let cost = |cluster: &Cluster| {
            let measured = &cluster.measured;
            if measured.weight < NEGLIGIBLE_WEIGHT {
                return None;
            }
            let noise = self.noise(measured, track.is_box());
            let sighting = track.sighting(&self.returns, cluster, &noise);
            let innovation = track.filter.innovation(&sighting);
            (innovation.chi_square() <= self.config.gate).then(|| innovation.cost())
        };
        found.iter().map(cost).collect()
    }

    /// Returns whether a cluster can begin a track.
    fn is_strong(&self, measured: &Measurement) -> bool {
        measured.returns >= self.config.min_returns
            && measured.weight >= self.config.min_weight
            && measured.range_m >= self.config.min_range_m
    }

    /// The covariance of the place of an end, of a box or of what has no heading yet, m².
    fn noise(&self, measured: &Measurement, is_box: bool) -> Matrix2<f64> {
        let edge_m = match is_box {
            true => self.config.edge_sigma_m,
            false => self.config.unknown_edge_sigma_m,
        };
        let (direction, range_m) = (&measured.direction, measured.range_m);
        self.resolution.noise(direction, range_m, edge_m)
    }

    /// Begins tracks at the clusters that belong to none. Those behind what stands are taken for
    /// mirror images: they become no objects, but what returns from them in the next scan is nobody
    /// else's.
    fn begin(&mut self, scan: &PlacedScan, rest: &[&Cluster]) {
        let sensor = Point2::from(scan.pose.translation.vector);
        for cluster in rest {
            let measured = &cluster.measured;
            if self.is_strong(measured) {
                let noise = self.noise(measured, false);
                let mut track = Track::new(&self.returns, cluster, &noise, &self.config);
                track.is_image = self.evidence.is_behind_standing(&sensor, &measured.at);
                self.tracks.push(track);
            }
        }
    }

    /// Ends tracks, joins those that have become one, and decides which move. What is behind
    /// something that stands becomes no object: in the first scans it was not known to stand.
    fn judge(&mut self) {
        let config = &self.config;
        self.tracks.retain(|track| !track.is_over(config));
        for track in &mut self.tracks {
            track.look_back(&self.evidence, config);
            let begins = track.judge(config);
            if begins && !self.evidence.is_hidden(&track.filter.position()) {
                track.confirm(self.next_id);
                self.next_id += 1;
            }
        }
        self.join();
    }

    /// Ends each track that an older object is, or whose other end it is.
    fn join(&mut self) {
        let config = &self.config;
        let mut index = 0;
        while index < self.tracks.len() {
            let (older, rest) = self.tracks.split_at_mut(index);
            let is_within = |older: &mut Track| {
                older.is_confirmed()
                    && (older.is_same(&rest[0], config) || older.unite(&rest[0], config))
            };
            match older.iter_mut().any(is_within) {
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
