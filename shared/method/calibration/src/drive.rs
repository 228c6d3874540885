//! The drive: its scans as points, and its track by odometry under assumed facts.

use gyre_geometry::{
    OwnedScan, PolarScan, Pose, Sense, SparsePoint, Twist, interpolate,
    samples::SensorConfigs,
    scan::{ScanError, flag},
};
use gyre_masking::MaskerError;
use gyre_matching::{
    Refiner, Searched, SettingError,
    odometry::{Odometry, OdometryConfig, OdometryError, Outcome, SetupError},
};
use gyre_radar::PointExtractor;

use crate::{
    OwnReflections,
    facts::{FactVector, Sign, correct},
};

/// Doppler coefficient of recordings that have none, s: small enough to change nothing, and it
/// keeps the sign of each chirp.
const NO_DOPPLER_S: f32 = 1e-9;
/// Motion from scan to scan above which the vehicle moves, m.
const MOVING_M: f64 = 0.5;

#[derive(Clone, Debug)]
pub struct Sweep {
    pub stamp_ns: i64,
    /// Time since the scan before, s; 0 where the chain of motions starts.
    pub interval_s: f64,
    pub searched: Pose,
    /// The points as measured under the configured facts.
    pub points: Vec<SparsePoint>,
}

pub struct Drive {
    odometry: Odometry,
    config: OdometryConfig,
    pub sweeps: Vec<Sweep>,
    pub(crate) sense: Sign,
    /// Chirps rise and fall by turns, as the scans report.
    pub(crate) alternates: bool,
    pub(crate) reflections: OwnReflections,
    extractor: PointExtractor,
}

#[derive(Clone, Debug)]
pub struct Track {
    pub poses: Vec<Pose>,
    /// From scan to scan.
    pub motions: Vec<Pose>,
    pub twists: Vec<Twist>,
    starts: Vec<bool>,
}

/// The difference of the track against the order of time from the track in that order.
#[derive(Clone, Copy, Debug)]
pub struct Reversal {
    /// The ratio of the lengths less 1.
    pub length: f64,
    /// The turn between the ends over the length, rad/m.
    pub turn_rad_per_m: f64,
}

impl Reversal {
    fn of(forward: &Track, reversed: &Track) -> Self {
        let [length_m, other_m] = [forward, reversed].map(|it| it.length_m().max(1e-3));
        let [end, other_end] = [forward, reversed].map(|it| it.poses.last().copied());
        let turn = end
            .zip(other_end)
            .map(|(end, other)| end.inv_mul(&other).rotation.angle());
        Self {
            length: other_m / length_m - 1.0,
            turn_rad_per_m: turn.unwrap_or_default() / length_m,
        }
    }
}

impl Drive {
    pub fn new(config: &OdometryConfig) -> Result<Self, SetupError> {
        Ok(Self {
            odometry: Odometry::new(config)?,
            config: config.clone(),
            sweeps: Vec::new(),
            sense: -1.0,
            alternates: false,
            reflections: OwnReflections::default(),
            extractor: PointExtractor::new(&config.points).map_err(MaskerError::from)?,
        })
    }

    pub fn config(&self) -> &OdometryConfig {
        &self.config
    }

    /// Adds the next scan.
    pub fn push(&mut self, scan: &OwnedScan) -> Result<(), OdometryError> {
        let mut scan = scan.view();
        if scan.geometry.doppler_s == 0.0 {
            scan.geometry.doppler_s = NO_DOPPLER_S;
        }
        let registered = self.odometry.register(&scan, &[])?;
        self.sense = match scan.geometry.sense {
            Sense::Clockwise => -1.0,
            Sense::CounterClockwise => 1.0,
        };
        self.alternates = scan
            .flags
            .iter()
            .any(|flags| flags & flag::CHIRP_KNOWN != 0);
        if registered.motion.motion.translation.vector.norm() > MOVING_M {
            self.reflections.add(&scan, self.config.masking.floor());
        }
        let points = match self.alternates {
            true => self.points_of_each_chirp(&scan)?,
            false => self.odometry.points().to_vec(),
        };
        self.sweeps.push(Sweep {
            stamp_ns: scan.geometry.stamp_ns,
            interval_s: match registered.outcome {
                Outcome::Start => 0.0,
                _ => registered.interval_ns as f64 * 1e-9,
            },
            searched: registered
                .searched
                .map_or(Pose::identity(), |found| found.motion.pose()),
            points,
        });
        Ok(())
    }

    /// Extracts the points of rising chirps, then the points of falling chirps. Together, the
    /// stronger of two neighbours suppresses the other where both chirps see it: of rising chirps
    /// the near edge of a thing would remain, of falling ones the far edge, which looks like a
    /// larger Doppler shift.
    fn points_of_each_chirp(
        &mut self,
        scan: &PolarScan<'_>,
    ) -> Result<Vec<SparsePoint>, ScanError> {
        let floor = self.config.masking.floor();
        let mut points = Vec::new();
        let mut buffer = vec![SparsePoint::default(); self.config.points.capacity / 2];
        for chirp in [flag::CHIRP_UP, 0] {
            let of_chirp = |flags: &u8| match flags & flag::CHIRP_UP == chirp {
                true => *flags,
                false => flags & !flag::MEASURED,
            };
            let flags: Vec<u8> = scan.flags.iter().map(of_chirp).collect();
            let scan = PolarScan {
                flags: &flags,
                ..*scan
            };
            let count = self.extractor.extract(&scan, floor, &mut buffer)?;
            points.extend_from_slice(&buffer[..count]);
        }
        Ok(points)
    }

    pub(crate) fn points(&self, scan: usize, change: &FactVector) -> Vec<SparsePoint> {
        let points = self.sweeps[scan].points.iter();
        points
            .map(|point| correct(point, change, self.sense, self.alternates))
            .collect()
    }

    /// Returns the mean of the tracks in both directions of time, where errors of the processing
    /// that depend on the direction cancel, and the difference of the two.
    pub fn mean_track(&self) -> Result<(Track, Reversal), SettingError> {
        self.mean_track_with(&FactVector::zeros())
    }

    pub(crate) fn mean_track_with(
        &self,
        change: &FactVector,
    ) -> Result<(Track, Reversal), SettingError> {
        let [forward, reversed] = [false, true].map(|reversed| self.track(change, reversed));
        let (forward, reversed) = (forward?, reversed?);
        let reversal = Reversal::of(&forward, &reversed);
        Ok((forward.mean(&reversed, self), reversal))
    }

    /// Registers all scans under changed facts, in the order of time or against it.
    fn track(&self, change: &FactVector, reversed: bool) -> Result<Track, SettingError> {
        let count = self.sweeps.len();
        let mut refiner = Refiner::new(
            &self.config.refinement,
            &SensorConfigs::default(),
            self.config.points.capacity,
        )?;
        let mut motions = vec![Pose::identity(); count];
        let mut earlier: Option<(usize, Vec<SparsePoint>)> = None;
        for number in 0..count {
            let scan = if reversed { count - 1 - number } else { number };
            let mut points = self.points(scan, change);
            if reversed {
                points.iter_mut().for_each(|point| {
                    point.time_s = -point.time_s;
                    point.doppler_s = -point.doppler_s;
                });
            }
            if let Some((before, from)) = &earlier {
                let later = scan.max(*before);
                let sweep = &self.sweeps[later];
                if sweep.interval_s <= 0.0 {
                    refiner.reset();
                } else {
                    let searched = match reversed {
                        true => sweep.searched.inverse(),
                        false => sweep.searched,
                    };
                    let refined = refiner.refine(&Searched::by_radar(
                        number as u64,
                        &points,
                        from,
                        &searched,
                        sweep.interval_s,
                    ));
                    let motion = refined.motion.alone().motion;
                    motions[later] = if reversed { motion.inverse() } else { motion };
                }
            }
            earlier = Some((scan, points));
        }
        Ok(Track::new(motions, self))
    }
}

impl Track {
    fn new(motions: Vec<Pose>, drive: &Drive) -> Self {
        let mut poses: Vec<Pose> = Vec::with_capacity(motions.len());
        for motion in &motions {
            let before = poses.last().copied().unwrap_or_else(Pose::identity);
            let mut next = before * motion;
            next.rotation.renormalize();
            poses.push(next);
        }
        let twists = (0..poses.len())
            .map(|scan| twist_at(&poses, drive, scan))
            .collect();
        let starts = drive.sweeps.iter().map(|it| it.interval_s <= 0.0);
        let starts = starts.collect();
        Self {
            poses,
            motions,
            twists,
            starts,
        }
    }

    pub fn path_m(&self) -> Vec<f64> {
        let mut path_m = 0.0;
        let up_to = |motion: &Pose| {
            path_m += motion.translation.vector.norm();
            path_m
        };
        self.motions.iter().map(up_to).collect()
    }

    pub fn length_m(&self) -> f64 {
        self.path_m().last().copied().unwrap_or_default()
    }

    pub(crate) fn is_broken(&self, earlier: usize, later: usize) -> bool {
        self.starts[earlier + 1..=later].contains(&true)
    }

    fn mean(&self, other: &Self, drive: &Drive) -> Self {
        let motions = self.motions.iter().zip(&other.motions);
        let motions = motions.map(|(own, others)| interpolate(own, others, 0.5));
        Self::new(motions.collect(), drive)
    }
}

/// The velocity at a scan: the mean over the intervals before and after it.
fn twist_at(poses: &[Pose], drive: &Drive, scan: usize) -> Twist {
    let interval = |scan: usize| drive.sweeps.get(scan).map_or(0.0, |sweep| sweep.interval_s);
    let (before_s, after_s) = (interval(scan), interval(scan + 1));
    if before_s + after_s <= 0.0 {
        return Twist::default();
    }
    let first = if before_s > 0.0 { scan - 1 } else { scan };
    let last = if after_s > 0.0 { scan + 1 } else { scan };
    Twist::from_chord(&poses[first].inv_mul(&poses[last]), before_s + after_s)
}
