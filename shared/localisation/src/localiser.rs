//! The localiser.

use gyre_estimation::places::{Candidate, Describer, Descriptor, LoopVerifier};
use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion, pose};
use gyre_scan_matching::{ConfigError, RefinementConfig, Submap};
use nalgebra::{Matrix3, Point2, Vector3};

use crate::{LocaliserOptions, Map};

/// Two fixes are the same within this angle, rad.
const SAME_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// A scan, with its motion by odometry.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Time of the scan, ns.
    pub stamp_ns: i64,
    /// Its points as measured.
    pub points: &'a [SparsePoint],
    /// The velocity of the sensor.
    pub twist: Twist,
    /// The motion from the scan before, with its covariance along that one's axes.
    pub motion: UncertainMotion,
}

/// What is known of the place of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Nothing.
    Lost,
    /// A first fix, without prior.
    Found,
    /// A fix near the prediction.
    Tracked,
    /// A prediction by odometry from the last fix.
    Predicted,
}

/// A measured place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// The pose in the map, with its covariance along the map's axes.
    pub pose: UncertainMotion,
    /// Masked correlation of the scan with the submap.
    pub correlation: f64,
    /// Difference of the correlation from that of any other pose that was tried; for a first fix only.
    pub margin: f64,
    /// The keyframe of the map with which it was registered.
    pub keyframe: usize,
}

/// The place of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Localisation {
    /// What is known.
    pub status: Status,
    /// The fix, or the prediction; `None` if lost or outside the map.
    pub fix: Option<Fix>,
}

/// The last known place.
#[derive(Clone, Copy)]
struct Track {
    pose: UncertainMotion,
    fixed_ns: i64,
}

/// Localises scans in a map.
///
/// Planned once; nothing is allocated afterwards.
pub struct Localiser {
    map: Map,
    options: LocaliserOptions,
    describer: Describer,
    descriptor: Descriptor,
    verifier: LoopVerifier,
    candidates: Vec<Candidate>,
    fixes: Vec<Fix>,
    scan: Submap,
    place: Submap,
    /// The keyframe whose submap `place` is.
    drawn: Option<usize>,
    track: Option<Track>,
}

impl Localiser {
    /// Plans the localisation of scans of at most `capacity` points. `refinement` is that of the odometry.
    ///
    /// # Errors
    /// The first value of `refinement` that is out of its bounds, or a reach of more than the rasters allow.
    pub fn new(
        map: Map,
        options: LocaliserOptions,
        refinement: &RefinementConfig,
        capacity: usize,
    ) -> Result<Self, ConfigError> {
        let points = capacity.max(map.largest());
        Ok(Self {
            verifier: LoopVerifier::new(&options.places, refinement, points)?,
            describer: Describer::new(),
            descriptor: Descriptor::default(),
            candidates: Vec::with_capacity(options.candidates),
            fixes: Vec::with_capacity(options.candidates),
            scan: Submap::with_capacity(capacity),
            place: map.new_submap(),
            drawn: None,
            track: None,
            map,
            options,
        })
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// Forgets the last known place.
    pub fn reset(&mut self) {
        self.track = None;
    }

    /// Localises the next scan.
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

    /// Finds the place of a scan without prior; `None` if it is not on the map, or if two places of the map look like it.
    pub fn find(&mut self, points: &[SparsePoint], twist: &Twist) -> Option<Fix> {
        let (min_correlation, min_margin) = (
            self.options.places.min_correlation,
            self.options.places.min_margin,
        );
        self.most_similar(points, twist)
            .filter(|fix| fix.correlation >= min_correlation && fix.margin >= min_margin)
    }

    /// Finds the pose at which a scan is most similar to the map, however little.
    pub fn most_similar(&mut self, points: &[SparsePoint], twist: &Twist) -> Option<Fix> {
        self.scan.start(points, twist);
        self.describer.describe(&self.scan, &mut self.descriptor);
        let similar = self.map.similar(&self.descriptor, self.options.apart_m);
        self.candidates.clear();
        self.candidates
            .extend(similar.iter().take(self.options.candidates));
        self.fixes.clear();
        for index in 0..self.candidates.len() {
            let candidate = self.candidates[index];
            self.draw(candidate.place);
            let found = self.verifier.verify(&self.scan, &self.place, &candidate);
            self.fixes.push(Fix {
                pose: self.in_map(candidate.place, &found.motion),
                correlation: found.correlation,
                margin: found.searched - found.runner_up,
                keyframe: candidate.place,
            });
        }
        let by_correlation = |a: &&Fix, b: &&Fix| a.correlation.total_cmp(&b.correlation);
        let best = *self.fixes.iter().max_by(by_correlation)?;
        let elsewhere = self.fixes.iter().filter(|fix| !self.is_same(&best, fix));
        let rival = elsewhere.max_by(by_correlation);
        let apart = rival.map_or(f64::INFINITY, |rival| best.correlation - rival.correlation);
        // A motion without covariance was not aligned.
        best.pose.has_covariance().then_some(Fix {
            margin: best.margin.min(apart),
            ..best
        })
    }

    fn is_same(&self, one: &Fix, other: &Fix) -> bool {
        let apart = one.pose.motion.inv_mul(&other.pose.motion);
        apart.translation.vector.norm() <= self.options.same_m
            && apart.rotation.angle().abs() <= SAME_RAD
    }

    /// Tracks the next scan from the last known place.
    fn follow(&mut self, track: &Track, observation: &Observation<'_>) -> Localisation {
        let predicted = track.pose.then(&observation.motion);
        self.scan.start(observation.points, &observation.twist);
        let place = Point2::from(predicted.motion.translation.vector);
        let (keyframe, distance_m) = self.map.nearest(place);
        let is_inside = distance_m <= self.options.reach_m;
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
        if without_s >= self.options.lost_after_s {
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

    /// Registers the scan with a keyframe, and updates the prediction with the result; `None` unless both agree.
    fn register(&mut self, keyframe: usize, predicted: &UncertainMotion) -> Option<Fix> {
        self.draw(keyframe);
        let initial = self.map.poses()[keyframe].inv_mul(&predicted.motion);
        let (motion, correlation) = self.verifier.register(&self.scan, &self.place, &initial)?;
        if correlation < self.options.tracked_correlation {
            return None;
        }
        let measured = self.in_map(keyframe, &motion);
        let pose = fused(predicted, &measured, self.options.gate)?;
        Some(Fix {
            pose,
            correlation,
            margin: 0.0,
            keyframe,
        })
    }

    /// A pose relative to a keyframe in the map's frame.
    fn in_map(&self, keyframe: usize, motion: &UncertainMotion) -> UncertainMotion {
        let of_keyframe = UncertainMotion {
            motion: self.map.poses()[keyframe],
            covariance: Matrix3::zeros(),
        };
        of_keyframe.then(motion)
    }

    fn draw(&mut self, keyframe: usize) {
        if self.drawn != Some(keyframe) {
            self.map.draw(keyframe, &mut self.place);
            self.drawn = Some(keyframe);
        }
    }
}

/// Updates a prediction with a measurement (Joseph form); `None` if their difference exceeds the gate.
fn fused(
    predicted: &UncertainMotion,
    measured: &UncertainMotion,
    gate: f64,
) -> Option<UncertainMotion> {
    let innovation = measured.error(&predicted.motion);
    let inverse = (predicted.covariance + measured.covariance).try_inverse()?;
    let chi_square = (innovation.transpose() * inverse * innovation).x;
    // Not a number is no agreement.
    if !(chi_square <= gate) {
        return None;
    }
    let gain = predicted.covariance * inverse;
    let rest = Matrix3::identity() - gain;
    Some(UncertainMotion {
        motion: moved(&predicted.motion, &(gain * innovation)),
        covariance: rest * predicted.covariance * rest.transpose()
            + gain * measured.covariance * gain.transpose(),
    })
}

/// A pose moved by (x, y, yaw) along the map's axes.
fn moved(from: &Pose, by: &Vector3<f64>) -> Pose {
    let [x, y, yaw] = gyre_geometry::xy_yaw(from);
    pose(x + by.x, y + by.y, yaw + by.z)
}
