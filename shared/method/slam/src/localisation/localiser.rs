use std::f64::consts::PI;

use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion, pose, wrap_angle, xy_yaw};
use gyre_matching::{RefinementConfig, SettingError, Submap};
use nalgebra::{Matrix3, Point2};

use crate::{
    estimation::places::{Candidate, Describer, Descriptor, Registrar},
    localisation::{Map, sight::Sight},
};

/// Two poses are the same within this angle, rad.
const SAME_RAD: f64 = 5.0 * PI / 180.0;
/// Two poses nearer than this, m, and than [`SAME_RAD`] are the same.
const SAME_M: f64 = 2.0;
/// The most similar poses of a search are aligned.
const ALIGNED: usize = 3;
/// Places and headings that are searched for a first fix: first these, and all if none of them is
/// accepted.
const FIRST_CANDIDATES: usize = 8;
const CANDIDATES: usize = 150;
/// Headings for comparing a place.
const ANGLES: usize = 3;
/// Two candidates are of different places if they are farther apart, m.
const APART_M: f64 = 10.0;
/// Smallest correlation of a first fix with the map, of a single scan with a submap of many, and
/// its smallest difference from the correlation of any other pose that was tried.
const MIN_CORRELATION: f64 = 0.4;
const MIN_MARGIN: f64 = 0.125;
/// Smallest correlation of a tracked scan with the map.
const TRACKED_CORRELATION: f64 = 0.35;
/// Largest chi-square (3 degrees of freedom) between a registration and the prediction: 99.9 %
/// pass.
const GATE: f64 = 16.27;
/// Distance from the nearest keyframe of the map beyond which there is no fix, m.
const REACH_M: f64 = 15.0;
const LOST_AFTER_S: f64 = 3.0;
/// Factor of the covariance of a registration with the map over a registration with the scans just
/// before.
const VARIANCE_SCALE: f64 = 2.0;

#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    pub stamp_ns: i64,
    pub points: &'a [SparsePoint],
    pub twist: Twist,
    /// The motion from the scan before, with its covariance along that one's axes.
    pub motion: UncertainMotion,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Lost,
    Found,
    Tracked,
    Predicted,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    pub pose: UncertainMotion,
    pub correlation: f64,
    /// Difference of the correlation from the next best pose that was tried; for a first fix only.
    pub margin: f64,
    /// The keyframe of the map that was used for registration.
    pub keyframe: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Localisation {
    pub status: Status,
    /// The fix, or the prediction; `None` if lost or outside the map.
    pub fix: Option<Fix>,
}

#[derive(Clone, Copy)]
struct Hypothesis {
    pose: Pose,
    correlation: f64,
    keyframe: usize,
}

#[derive(Clone, Copy)]
struct Track {
    pose: UncertainMotion,
    fixed_ns: i64,
}

pub struct Localiser {
    map: Map,
    describer: Describer,
    descriptor: Descriptor,
    registrar: Registrar,
    sight: Sight,
    candidates: Vec<Candidate>,
    hypotheses: Vec<Hypothesis>,
    scan: Submap,
    place: Submap,
    drawn: Option<usize>,
    track: Option<Track>,
}

impl Localiser {
    /// Plans the localisation of scans of at most `capacity` points. `refinement` is the
    /// odometry's.
    pub fn new(
        map: Map,
        refinement: &RefinementConfig,
        capacity: usize,
    ) -> Result<Self, SettingError> {
        Ok(Self {
            registrar: Registrar::new(refinement, capacity)?,
            sight: Sight::new(Registrar::CELLS),
            describer: Describer::new(),
            descriptor: Descriptor::default(),
            candidates: Vec::with_capacity(CANDIDATES),
            hypotheses: Vec::with_capacity(4 * CANDIDATES),
            scan: Submap::with_capacity(capacity),
            place: map.new_submap(),
            drawn: None,
            track: None,
            map,
        })
    }

    pub fn map(&self) -> &Map {
        &self.map
    }

    pub fn reset(&mut self) {
        self.track = None;
    }

    /// Takes the pose of the next scan from elsewhere, with its covariance: the scan is only
    /// aligned near it.
    pub fn place(&mut self, pose: UncertainMotion, stamp_ns: i64) {
        self.track = Some(Track {
            pose,
            fixed_ns: stamp_ns,
        });
    }

    pub fn locate(&mut self, observation: &Observation<'_>) -> Localisation {
        match self.track {
            None => self.start(observation),
            Some(track) => self.follow(&track, observation),
        }
    }

    fn start(&mut self, observation: &Observation<'_>) -> Localisation {
        let fix = self.find(observation.points, &observation.twist);
        self.track = fix.map(|fix| Track {
            pose: fix.pose,
            fixed_ns: observation.stamp_ns,
        });
        let status = fix.map_or(Status::Lost, |_| Status::Found);
        Localisation { status, fix }
    }

    fn look(&mut self, points: &[SparsePoint], twist: &Twist) {
        self.scan.start(points, twist);
        self.registrar.set_later(&self.scan);
        self.sight.look(&self.scan);
    }

    /// Finds the place of a scan without prior; `None` if it is not on the map, or if two places of
    /// the map look like it.
    pub fn find(&mut self, points: &[SparsePoint], twist: &Twist) -> Option<Fix> {
        self.look(points, twist);
        self.describer.describe(&self.scan, &mut self.descriptor);
        self.choose_candidates();
        self.hypotheses.clear();
        let few = FIRST_CANDIDATES.min(self.candidates.len());
        (0..few).for_each(|k| self.search(k));
        let fix = self.best().filter(|fix| self.is_accepted(fix));
        fix.or_else(|| {
            (few..self.candidates.len()).for_each(|k| self.search(k));
            self.best().filter(|fix| self.is_accepted(fix))
        })
    }

    fn is_accepted(&self, fix: &Fix) -> bool {
        let place = Point2::from(fix.pose.motion.translation.vector);
        fix.correlation >= MIN_CORRELATION
            && fix.margin >= MIN_MARGIN
            && self.map.nearest(place).1 <= REACH_M
    }

    fn choose_candidates(&mut self) {
        let similar = self.map.similar(&self.descriptor, ANGLES).to_vec();
        self.candidates.clear();
        for candidate in similar {
            let is_new = |other: &Candidate| {
                let [one, other] = [&candidate, other].map(|c| (self.map.pose(c.place), c.yaw_rad));
                let apart_m = (one.0.translation.vector - other.0.translation.vector).norm();
                let turned = |(pose, yaw_rad): (Pose, f64)| pose.rotation.angle() + yaw_rad;
                // Up to half a turn.
                let apart_rad = 0.5 * wrap_angle(2.0 * (turned(one) - turned(other)));
                apart_m >= APART_M || apart_rad.abs() > SAME_RAD
            };
            if self.candidates.iter().all(is_new) {
                self.candidates.push(candidate);
            }
            if self.candidates.len() == CANDIDATES {
                break;
            }
        }
    }

    /// Searches around a candidate, at both headings, since its descriptor is ambiguous by half a
    /// turn.
    fn search(&mut self, candidate: usize) {
        let Candidate { place, yaw_rad, .. } = self.candidates[candidate];
        self.draw(place);
        self.registrar.set_earlier(&self.place);
        for yaw_rad in [yaw_rad, wrap_angle(yaw_rad + PI)] {
            let found = self.registrar.search(yaw_rad, self.sight.seen());
            let second = found
                .runner_up
                .map(|other| (other.x_m, other.y_m, other.score));
            let first = (found.x_m, found.y_m, found.score);
            for (x_m, y_m, correlation) in [Some(first), second].into_iter().flatten() {
                self.hypotheses.push(Hypothesis {
                    pose: self.map.pose(place) * pose(x_m, y_m, yaw_rad),
                    correlation,
                    keyframe: place,
                });
            }
        }
    }

    /// Aligns the best poses that were found, and compares the best of them with all others.
    fn best(&mut self) -> Option<Fix> {
        self.hypotheses
            .sort_by(|a, b| b.correlation.total_cmp(&a.correlation));
        let mut best: Option<Fix> = None;
        for k in 0..self.hypotheses.len().min(ALIGNED) {
            let Hypothesis { pose, keyframe, .. } = self.hypotheses[k];
            if let Some(fix) = self.align(keyframe, &pose)
                && best.is_none_or(|best| fix.correlation > best.correlation)
            {
                best = Some(fix);
            }
        }
        let best = best.filter(|best| best.pose.has_covariance())?;
        let others = self.hypotheses.iter();
        let rival = others
            .filter(|other| !self.is_same(&best.pose.motion, &other.pose))
            .map(|other| other.correlation)
            .fold(0.0, f64::max);
        Some(Fix {
            margin: best.correlation - rival,
            ..best
        })
    }

    fn is_same(&self, one: &Pose, other: &Pose) -> bool {
        let apart = one.inv_mul(other);
        apart.translation.vector.norm() <= SAME_M && apart.rotation.angle().abs() <= SAME_RAD
    }

    /// Aligns the scan with the submap of a keyframe; the fix has no margin.
    fn align(&mut self, keyframe: usize, from: &Pose) -> Option<Fix> {
        self.draw(keyframe);
        self.registrar.set_earlier(&self.place);
        let initial = self.map.pose(keyframe).inv_mul(from);
        let aligner = &mut self.registrar.aligner;
        let mut motion = aligner.align(&self.scan, &self.place, true, &initial)?;
        motion.covariance *= VARIANCE_SCALE;
        let seen = self.sight.seen();
        let correlation = self.registrar.correlation(&motion.motion, seen);
        let of_keyframe = UncertainMotion {
            motion: self.map.pose(keyframe),
            covariance: Matrix3::zeros(),
        };
        Some(Fix {
            pose: of_keyframe.then(&motion),
            correlation,
            margin: 0.0,
            keyframe,
        })
    }

    fn follow(&mut self, track: &Track, observation: &Observation<'_>) -> Localisation {
        let predicted = track.pose.then(&observation.motion);
        self.look(observation.points, &observation.twist);
        let place = Point2::from(predicted.motion.translation.vector);
        let (keyframe, distance_m) = self.map.nearest(place);
        let is_inside = distance_m <= REACH_M;
        if let Some(fix) = self.register(keyframe, &predicted).filter(|_| is_inside) {
            self.track = Some(Track {
                pose: fix.pose,
                fixed_ns: observation.stamp_ns,
            });
            return Localisation {
                status: Status::Tracked,
                fix: Some(fix),
            };
        }
        let without_s = (observation.stamp_ns - track.fixed_ns) as f64 * 1e-9;
        if without_s >= LOST_AFTER_S {
            return self.start(observation);
        }
        self.track = Some(Track {
            pose: predicted,
            ..*track
        });
        let prediction = Fix {
            pose: predicted,
            correlation: 0.0,
            margin: 0.0,
            keyframe,
        };
        Localisation {
            status: Status::Predicted,
            fix: is_inside.then_some(prediction),
        }
    }

    /// Registers the scan with a keyframe, and updates the prediction with the result; `None`
    /// unless both agree.
    fn register(&mut self, keyframe: usize, predicted: &UncertainMotion) -> Option<Fix> {
        let measured = self.align(keyframe, &predicted.motion)?;
        if measured.correlation < TRACKED_CORRELATION {
            return None;
        }
        Some(Fix {
            pose: fused(predicted, &measured.pose)?,
            ..measured
        })
    }

    fn draw(&mut self, keyframe: usize) {
        if self.drawn != Some(keyframe) {
            self.map.draw(keyframe, &mut self.place);
            self.drawn = Some(keyframe);
        }
    }
}

/// Updates a prediction with a measurement (Joseph form); `None` if their difference exceeds the
/// gate.
fn fused(predicted: &UncertainMotion, measured: &UncertainMotion) -> Option<UncertainMotion> {
    let innovation = measured.error(&predicted.motion);
    let inverse = (predicted.covariance + measured.covariance).try_inverse()?;
    let chi_square = (innovation.transpose() * inverse * innovation).x;
    // Not a number does not.
    let agrees = chi_square <= GATE;
    if !agrees {
        return None;
    }
    let gain = predicted.covariance * inverse;
    let rest = Matrix3::identity() - gain;
    let ([x, y, yaw], by) = (xy_yaw(&predicted.motion), gain * innovation);
    Some(UncertainMotion {
        motion: pose(x + by.x, y + by.y, yaw + by.z),
        covariance: rest * predicted.covariance * rest.transpose()
            + gain * measured.covariance * gain.transpose(),
    })
}
