//! Refinement of (x, y, yaw) by aligning sparse points with a local map of the last keyframes.
//!
//! The map is the mean of the last keyframes, each drawn once from its own points at its own pose,
//! blurred and saturated. A scan is aligned with it by Gauss-Newton steps, first on a coarse map
//! and then on the fine one, and is deskewed with the very motion that is sought.

mod alignment;
mod along_walls;
mod candidates;
mod config;
mod filter;
mod keyframe_aligner;
mod local_map;
mod map_level;
mod normal_equations;
mod points;
mod predicted;
mod registration;
mod sensors;
mod standstill;
mod structure;
mod submap;
mod tracker;
mod uncertainty;

use gyre_geometry::{
    OdometryMotion, Pose, SparsePoint, Twist, UncertainMotion,
    samples::{AllEvidence, Evidence, SensorConfigs, Witness},
};
use nalgebra::{Matrix3, UnitVector2, Vector2};

use crate::SettingError;
use alignment::Alignment;
use candidates::{Candidate, Candidates, Scan};
use filter::SharedErrors;
use local_map::LocalMap;
use points::DeskewedPoints;
use standstill::{Estimate, Report};
use uncertainty::Uncertainty;

pub use candidates::InitialGuess;
pub use config::{RefinementConfig, RefinementKind};
pub use filter::{Filter, Verdict};
pub use keyframe_aligner::KeyframeAligner;
pub use local_map::Keyframe;
pub use predicted::SinceMatch;
pub use standstill::Standstill;
pub use submap::Submap;
pub use tracker::{Anchor, TrackerState};

/// After this many doubtful scans in a row a plausible match is accepted.
const MAX_DOUBTFUL: u32 = 2;
/// Number of consecutive scans without a match after which a new map is started.
const MAX_UNMATCHED: u32 = 5;
/// Weight of the scan's points, as a share of its running mean, below which a match is `weak`.
const MIN_SUPPORT: f64 = 0.6;
/// Distance and angle from the searched motion above which a match is `weak`, m and degrees.
const SEARCH_AGREES_M: f64 = 2.0;
const SEARCH_AGREES_DEG: f64 = 6.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Refined,
    /// Aligned, but doubtful; kept out of the map.
    Weak,
    /// No plausible match: the motion is predicted at constant velocity.
    Predicted,
}

#[derive(Debug, Clone, Copy)]
pub struct Refined {
    /// Pose of the later scan's frame in the earlier one's, with its covariance.
    pub motion: OdometryMotion,
    /// Mean of the map under the points, 0 to 1.
    pub overlap: f64,
    /// Weight of the points as a share of its running mean; 1 without a mean yet.
    pub support: f64,
    pub outcome: Outcome,
    /// The initial guess of the accepted match; the prediction without a match.
    pub guess: InitialGuess,
    pub stationary: bool,
    /// The sensors that have measured the motion, in the order of [`Witness::ALL`].
    pub witnesses: [Option<Witnessed>; Witness::ALL.len()],
}

/// A sensor beside the radar in a motion, and its errors after the scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Witnessed {
    pub verdict: Verdict,
    /// The turn (rad), the distance (m) or the heading (rad) that it measured.
    pub measured: f64,
    /// The same turn or distance by the registration alone; zero without a match.
    pub registered: f64,
    /// True value over the measured one.
    pub scale: f64,
    pub scale_sigma: f64,
    /// Bias, rad/s; the offset of an absolute heading, rad; zero of a distance.
    pub bias: f64,
    pub bias_sigma: f64,
}

struct Accepted {
    outcome: Outcome,
    pose: UncertainMotion,
    /// The covariance of a motion to the pose that has the heading of the filter.
    covariance: Matrix3<f64>,
    guess: InitialGuess,
    ahead_m: Vector2<f64>,
    /// Walls without structure have ended: the map is left.
    leaves_map: bool,
}

/// A searched motion, and the scans and measurements to refine it with.
#[derive(Debug, Clone, Copy)]
pub struct Searched<'a> {
    /// The number of the later scan.
    pub scan: u64,
    pub later: &'a [SparsePoint],
    /// Used only while the map is empty.
    pub earlier: &'a [SparsePoint],
    /// The motion that the search found.
    pub motion: Pose,
    /// Time between the stamps, s.
    pub interval_s: f64,
    /// Variance of the turn by the mean azimuths of both scans, rad². Where azimuths were lost, all
    /// points of a sector err alike, and the mean azimuth by its share of the turn; the motion
    /// takes back the error of the earlier scan.
    pub azimuth_variance_rad2: f32,
    /// The evidence that came with the earlier scan and with the later one.
    pub evidence: [&'a AllEvidence; 2],
}

impl<'a> Searched<'a> {
    /// A searched motion that no other sensor has measured.
    pub fn by_radar(
        scan: u64,
        later: &'a [SparsePoint],
        earlier: &'a [SparsePoint],
        motion: &Pose,
        interval_s: f64,
    ) -> Self {
        const NONE: AllEvidence = [Evidence::NONE; Witness::ALL.len()];
        Self {
            scan,
            later,
            earlier,
            motion: *motion,
            interval_s,
            azimuth_variance_rad2: 0.0,
            evidence: [&NONE; 2],
        }
    }
}

/// Refines motions scan by scan against a map of the last keyframes.
#[derive(Debug)]
pub struct Refiner {
    config: RefinementConfig,
    sensors: SensorConfigs,
    errors: [SharedErrors; Witness::ALL.len()],
    map: LocalMap,
    state: TrackerState,
    points: DeskewedPoints,
    other_points: DeskewedPoints,
}

impl Refiner {
    /// Plans refinements of scans of at most `capacity` points.
    pub fn new(
        config: &RefinementConfig,
        sensors: &SensorConfigs,
        capacity: usize,
    ) -> Result<Self, SettingError> {
        config.validate()?;
        Ok(Self {
            map: LocalMap::new(config),
            config: config.clone(),
            sensors: sensors.clone(),
            errors: SharedErrors::of(sensors),
            state: TrackerState::default(),
            points: DeskewedPoints::with_capacity(capacity),
            other_points: DeskewedPoints::with_capacity(capacity),
        })
    }

    /// Refines the motion from the earlier scan to the later one.
    pub fn refine(&mut self, searched: &Searched<'_>) -> Refined {
        let mut scan = self.predicted_scan(searched);
        let predictions = self.ensure_map(&scan, searched.earlier);
        let mut best = self.best_match(&mut scan);
        let (map, state, config) = (&self.map, &self.state, &self.config);
        let uncertainty = Uncertainty::before(&scan, map, state, predictions, config);
        let accepted = self.accept_or_predict(&scan, &mut best, &uncertainty);
        self.observe_headings(&scan, &accepted.pose.motion);
        let witnesses = self.witnessed(&scan, &accepted);
        let report = self.report(&scan, &accepted);
        self.update(&scan, &best, &accepted);
        Refined {
            motion: OdometryMotion {
                motion: report.motion.motion,
                covariance: uncertainty.of_report(&report),
                drift_share: uncertainty.drift_share(accepted.outcome, &self.map),
                scale_sigma: self.config.scale_sigma,
            },
            overlap: best.overlap,
            support: best.support,
            guess: accepted.guess,
            outcome: accepted.outcome,
            stationary: report.stationary,
            witnesses,
        }
    }

    /// Forgets the map and the tracker state but for the filters of the sensors: the next scan
    /// starts a new chain of motions.
    pub fn reset(&mut self) {
        self.map.clear();
        self.state.leave_map();
        let filters = self.state.filters.iter_mut().flatten();
        filters.for_each(Filter::start_chain);
        self.state = TrackerState {
            filters: self.state.filters,
            ..TrackerState::default()
        };
    }

    /// Restores an earlier state. `load` fills in the next keyframe, oldest first, and returns
    /// whether there was one.
    pub fn restore(&mut self, state: TrackerState, load: impl FnMut(&mut Keyframe) -> bool) {
        self.map.restore(load);
        self.state = state;
    }

    pub fn state(&self) -> &TrackerState {
        &self.state
    }

    pub fn keyframes(&self) -> impl Iterator<Item = &Keyframe> {
        self.map.keyframes()
    }

    pub fn keyframe_cells(&self) -> usize {
        self.map.keyframe_cells()
    }

    fn predicted_scan<'a>(&mut self, searched: &Searched<'a>) -> Scan<'a> {
        // Stamps that do not advance give no velocity: a second is assumed.
        let interval_s = match searched.interval_s > 0.0 {
            true => searched.interval_s,
            false => 1.0,
        };
        Scan {
            id: searched.scan,
            points: searched.later,
            searched: self.state.pose * searched.motion,
            step: self.predict(searched.evidence, interval_s),
            azimuth_variance_rad2: searched.azimuth_variance_rad2.into(),
        }
    }

    /// Starts a map if the refiner has no map. Returns the number of predictions in a row whose
    /// error a match takes back: none with a new map, which starts at the pose that they led to,
    /// with their error.
    fn ensure_map(&mut self, scan: &Scan<'_>, earlier: &[SparsePoint]) -> u32 {
        if !self.map.is_empty() {
            return self.state.unmatched;
        }
        self.start_map(scan, earlier);
        0
    }

    /// Makes the earlier scan the first keyframe, deskewed with the motion to the later scan: first
    /// with the searched motion, then with the one that aligning the later scan gives.
    fn start_map(&mut self, scan: &Scan<'_>, earlier: &[SparsePoint]) {
        let (id, pose) = (scan.id.wrapping_sub(1), self.state.pose);
        let twist = self.state.twist_to(&scan.searched, &scan.step);
        self.insert_keyframe(id, earlier, &pose, &twist);
        let aligned = self.candidates(scan).match_prediction_or_search();
        let pose_of_later = aligned.alignment.pose;
        let twist = self.state.twist_to(&pose_of_later, &scan.step);
        self.map.clear();
        self.insert_keyframe(id, earlier, &pose, &twist);
    }

    fn candidates<'a>(&'a mut self, scan: &'a Scan<'a>) -> Candidates<'a> {
        Candidates {
            scan,
            map: &self.map,
            state: &self.state,
            config: &self.config,
            points: &mut self.points,
        }
    }

    /// Returns the pose of a plausible match and the covariance of its motion, or the predicted
    /// ones.
    fn accept_or_predict(
        &mut self,
        scan: &Scan<'_>,
        best: &mut Candidate,
        uncertainty: &Uncertainty,
    ) -> Accepted {
        let Some(found) = self.plausible_match(scan, best, uncertainty) else {
            return self.predicted(scan, uncertainty);
        };
        let is_certain = self.is_firm(scan, best, found.undetermined);
        let is_firm = is_certain || found.leaves_map || self.state.doubtful >= MAX_DOUBTFUL;
        let (outcome, factor) = match is_firm {
            true => (Outcome::Refined, 1.0),
            false => (Outcome::Weak, uncertainty::WEAK_FACTOR),
        };
        let registered = UncertainMotion {
            covariance: found.registered.covariance * factor,
            ..found.registered
        };
        if best.guess == InitialGuess::AlongWalls {
            self.propagate_along_walls(scan, &registered);
        } else if self.update_distances(scan, &registered, is_certain) {
            (self.state.along_walls, self.state.sliding) = (0, 0);
        } else {
            return self.predicted(scan, uncertainty);
        }
        Accepted {
            outcome,
            covariance: self.update_heading(scan, &registered, best.guess),
            pose: registered,
            guess: best.guess,
            ahead_m: found.ahead_m,
            leaves_map: found.leaves_map,
        }
    }

    /// Returns the pose of an alignment with the covariance of the motion to it; `None` if the
    /// points do not determine it.
    fn registered(&self, scan: &Scan<'_>, alignment: &Alignment) -> Option<UncertainMotion> {
        let (points, previous) = (&self.points, &self.state.pose);
        let covariance = uncertainty::of_alignment(alignment, points, previous, &self.config)?;
        Some(UncertainMotion {
            motion: alignment.pose,
            covariance: covariance
                + uncertainty::by_azimuths(alignment, scan.azimuth_variance_rad2),
        })
    }

    fn predicted(&mut self, scan: &Scan<'_>, uncertainty: &Uncertainty) -> Accepted {
        let [motion, _] = self.state.predict(&scan.step);
        let covariance = uncertainty.of_prediction;
        let pose = UncertainMotion { motion, covariance };
        let alone = UncertainMotion {
            motion: self.state.pose.inv_mul(&motion),
            covariance,
        };
        self.propagate(scan, &pose, &alone);
        let ahead_m = match self.state.sliding > 0 && scan.step.distance.is_none() {
            true => scan.searched.translation.vector - motion.translation.vector,
            false => Vector2::zeros(),
        };
        Accepted {
            outcome: Outcome::Predicted,
            pose,
            covariance,
            guess: InitialGuess::Prediction,
            ahead_m,
            leaves_map: false,
        }
    }

    /// Returns whether the scan overlaps the map well, has enough points, and agrees with the
    /// search, except in a direction that both leave undetermined.
    fn is_firm(
        &self,
        scan: &Scan<'_>,
        best: &Candidate,
        undetermined: Option<UnitVector2<f64>>,
    ) -> bool {
        self.fits_firmly(best) && self.agrees_with_search(scan, best, undetermined)
    }

    fn fits_firmly(&self, best: &Candidate) -> bool {
        best.overlap >= self.config.firm_overlap * self.state.mean_overlap
            && best.support >= MIN_SUPPORT
    }

    /// Returns whether the motion is near the search's, except in a direction that both leave
    /// undetermined.
    fn agrees_with_search(
        &self,
        scan: &Scan<'_>,
        best: &Candidate,
        undetermined: Option<UnitVector2<f64>>,
    ) -> bool {
        let mut apart = scan.searched.inv_mul(&best.alignment.pose);
        if let Some(along) = undetermined {
            let along = scan.searched.rotation.inverse() * along.into_inner();
            let shift = &mut apart.translation.vector;
            *shift -= along * along.dot(shift);
        }
        apart.translation.vector.norm() <= SEARCH_AGREES_M
            && apart.rotation.angle().abs() <= SEARCH_AGREES_DEG.to_radians()
    }

    /// Returns the motion to the estimated pose, with the heading of the gyro's filter.
    fn report(&mut self, scan: &Scan<'_>, accepted: &Accepted) -> Report {
        let mut report = self.hold_standstill(scan, accepted);
        if let (false, Some(heading)) = (report.stationary, self.state.heading_mut()) {
            report.motion.motion = heading.correct(&report.motion.motion);
        }
        report
    }

    /// Returns the motion to the estimated pose; none while the vehicle stands. Displacement along
    /// a featureless corridor is unobservable, so standstill cannot be detected there, and a
    /// prediction cannot detect it either.
    fn hold_standstill(&mut self, scan: &Scan<'_>, accepted: &Accepted) -> Report {
        let estimate = Estimate {
            pose: accepted.pose,
            covariance: accepted.covariance,
            previous: self.state.pose,
            outcome: match accepted.guess {
                InitialGuess::AlongWalls => Outcome::Predicted,
                _ => accepted.outcome,
            },
            moves: scan.step.moves(),
            interval_s: scan.step.interval_s,
        };
        match self.config.hold_standstill {
            true => self.state.standstill.next(&estimate),
            false => estimate.unheld(),
        }
    }

    fn update(&mut self, scan: &Scan<'_>, best: &Candidate, accepted: &Accepted) {
        let (pose, outcome) = (&accepted.pose.motion, accepted.outcome);
        let (config, fit) = (&self.config, [best.overlap, best.weight]);
        // Along predicted displacements, keyframes are placed and deskewed by the search.
        let mut by_search = *pose;
        by_search.translation.vector += accepted.ahead_m;
        let twist = self.state.twist_to(&by_search, &scan.step);
        self.state.update(*pose, outcome, fit, &scan.step, config);
        self.state.ahead_m += accepted.ahead_m;
        let ahead_m = self.state.ahead_m;
        if accepted.leaves_map || self.state.unmatched >= MAX_UNMATCHED {
            // A new map starts with this scan at the next call, and so on until two scans match.
            self.map.clear();
            self.state.leave_map();
        } else if outcome == Outcome::Refined && self.map.needs_keyframe(pose, ahead_m) {
            self.insert_keyframe(scan.id, scan.points, pose, &twist);
        }
    }

    fn insert_keyframe(&mut self, id: u64, points: &[SparsePoint], pose: &Pose, twist: &Twist) {
        self.points.deskew(points, twist);
        self.map.insert(id, &self.points, pose, self.state.ahead_m);
    }
}
