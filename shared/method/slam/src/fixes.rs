//! The fixes of GNSS of a drive: which keyframe each belongs to, and what became of it.

use std::ops::Range;

use gyre_geometry::{
    Pose, interpolate,
    samples::{GnssConfig, GnssFix},
};
use gyre_radar::{ClockOffset, Trajectory, clock_offset, median};
use nalgebra::{Point2, Vector2};

use crate::estimation::{EstimationError, PoseGraph, Position};

/// The acceleration of vehicles that brake, m/s²: between two keyframes a place is known as well as
/// if they had moved evenly, but for this.
const ACCELERATION_MPS2: f64 = 2.0;
/// A place that is less certain than this and than the fix itself gives no evidence, m.
const FAR_M: f64 = 1.0;
/// A clock is wrong if the vehicle moves within its offset by more than so many standard deviations
/// of a fix.
const CLOCK_SIGMAS: f64 = 3.0;
/// A fix with a weight below this counts as unused: it pulls less than a quarter as hard.
const LEAST_WEIGHT: f64 = 0.25;
/// The share of the fixes that must agree with each other and with the rest.
const LEAST_SHARE: f64 = 0.5;

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FixRefusal {
    /// None was measured between two keyframes.
    #[error(
        "there is no fix from the first keyframe to the last: the log is of a different drive, or gnss.delay_s is wrong"
    )]
    Elsewhere,
    /// Their clock differs from the radar's by this.
    #[error(
        "by the speeds of both the fixes are {0} against the radar: add that to gnss.delay_s if it is their clock"
    )]
    Clock(ClockOffset),
    /// Most of them contradict the others, the odometry or the loops.
    #[error(
        "only {agreeing} of {taken} fixes agree with each other and with the radar: gnss.delay_s is wrong, sigma_m is too small, or they are of a different drive"
    )]
    Contradictory { agreeing: usize, taken: usize },
    /// They are so close together that they do not determine the heading.
    #[error("the fixes are too near each other for their uncertainty to determine the heading")]
    Undetermined,
}

/// The fixes of a log by what became of them. The first three and `taken` are all fixes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixCounts {
    /// Before the first keyframe or after the last.
    pub outside: usize,
    /// A different fix is nearer to the same keyframe: its error is dependent.
    pub thinned: usize,
    /// Too far from a keyframe for odometry to determine the vehicle's position, as while it stood.
    pub far: usize,
    /// Given to the graph, one for each keyframe.
    pub taken: usize,
}

#[derive(Clone, Debug, Default)]
pub struct Fixes {
    fixes: Vec<GnssFix>,
    lever_m: Vector2<f64>,
    correlation_s: f64,
    /// The first fix that is not before the last keyframe.
    next: usize,
    counts: FixCounts,
    taken: Vec<(i64, Position)>,
    clock: Option<ClockOffset>,
    refusal: Option<FixRefusal>,
}

#[derive(Clone, Copy)]
pub(crate) struct Stamped {
    pub stamp_ns: i64,
    pub odometry: Pose,
}

impl Fixes {
    /// Takes the fixes of a drive on the radar's clock, in the order of their stamps.
    pub fn new(fixes: Vec<GnssFix>, config: &GnssConfig) -> Self {
        Self {
            fixes,
            lever_m: Vector2::from(config.lever_m),
            correlation_s: config.correlation_s,
            ..Self::default()
        }
    }

    pub fn counts(&self) -> FixCounts {
        let counted = self.counts.outside + self.counts.thinned + self.counts.far;
        FixCounts {
            outside: self.counts.outside + self.fixes.len() - counted - self.taken.len(),
            taken: self.taken.len(),
            ..self.counts
        }
    }

    /// Returns the offset of the clock of the fixes as of the last solution: their delay; `None` if
    /// the drive does not determine it.
    pub fn clock(&self) -> Option<ClockOffset> {
        self.clock
    }

    /// Returns why none are used as of the last solution; `None` if some are.
    pub fn refusal(&self) -> Option<&FixRefusal> {
        self.refusal.as_ref()
    }

    /// Returns the fixes that the keyframes have, with their times, ns since 1970.
    pub fn positions(&self) -> &[(i64, Position)] {
        &self.taken
    }

    pub fn taken(&self) -> usize {
        self.taken.len()
    }

    /// Returns how many of them stay: fixes arrive in the order of their stamps, so that those
    /// between two keyframes are complete once there is one of a later time.
    pub fn settled(&self) -> usize {
        let is_complete = self.next < self.fixes.len();
        self.taken.len() - usize::from(!is_complete && !self.taken.is_empty())
    }

    /// Takes the fix between two keyframes whose place is known best, if there is one: against the
    /// earlier one, with odometry's motion to its own time.
    pub(crate) fn advance(&mut self, keyframe: usize, from: Stamped, to: Stamped) {
        if keyframe == 0 {
            self.next = self
                .fixes
                .partition_point(|fix| fix.stamp_ns < from.stamp_ns);
            self.counts.outside = self.next;
        }
        let rest = &self.fixes[self.next..];
        let count = rest.partition_point(|fix| fix.stamp_ns < to.stamp_ns);
        let between = &rest[..count];
        let best = between
            .iter()
            .min_by(|a, b| off_even(a, from, to).total_cmp(&off_even(b, from, to)));
        self.next += count;
        let Some(best) = best else { return };
        let off_m = off_even(best, from, to);
        if off_m > best.sigma_m.max(FAR_M) {
            self.counts.far += count;
            return;
        }
        self.counts.thinned += count - 1;
        let position = Position {
            keyframe,
            lever_m: self.antenna(best, from, to),
            position_m: Vector2::new(best.east_m, best.north_m),
            variance_m2: best.sigma_m * best.sigma_m + off_m * off_m,
            share: self.share(best.stamp_ns),
        };
        self.taken.push((best.stamp_ns, position));
    }

    /// Returns where the antenna was at the time of a fix, in the frame of the keyframe before.
    fn antenna(&self, fix: &GnssFix, from: Stamped, to: Stamped) -> Vector2<f64> {
        let motion = from.odometry.inv_mul(&to.odometry);
        let share = (fix.stamp_ns - from.stamp_ns) as f64 / (to.stamp_ns - from.stamp_ns) as f64;
        let moved = interpolate(&Pose::identity(), &motion, share);
        (moved * Point2::from(self.lever_m)).coords
    }

    /// Returns how much the next fix counts. Errors that are correlated by r = exp(-dt/T) from one
    /// fix to the next, a Gauss-Markov process, determine a constant as well as (1 - r) / (1 + r)
    /// times as many independent ones.
    fn share(&self, stamp_ns: i64) -> f64 {
        let Some((last_ns, _)) = self.taken.last() else {
            return 1.0;
        };
        let seconds = (stamp_ns - last_ns) as f64 * 1e-9;
        let half = 0.5 * seconds / self.correlation_s;
        half.tanh().clamp(f64::MIN_POSITIVE, 1.0)
    }

    /// Takes over the findings of the last solution, which used the first of the same fixes.
    pub(crate) fn go_on_from(&mut self, before: &Self) {
        self.clock = before.clock;
        self.refusal.clone_from(&before.refusal);
    }

    pub(crate) fn give(
        &self,
        graph: &mut PoseGraph,
        which: Range<usize>,
    ) -> Result<(), EstimationError> {
        let mut new = self.taken[which].iter();
        new.try_for_each(|(_, position)| graph.measure(*position))
    }

    /// Compares the clock of the fixes with the radar's, by their speeds.
    pub(crate) fn compare_clocks(&mut self, keyframes: &[Stamped]) {
        self.clock = self.offset(keyframes);
        let wrong = self.clock.filter(|clock| self.is_wrong(clock, keyframes));
        self.refusal = match wrong {
            _ if self.taken.is_empty() => Some(FixRefusal::Elsewhere),
            Some(clock) => Some(FixRefusal::Clock(clock)),
            None => None,
        };
    }

    pub(crate) fn check(&mut self, graph: &PoseGraph) {
        let taken = graph.positions().count();
        let agreeing = graph.positions().filter(|it| it.weight >= LEAST_WEIGHT);
        let agreeing = agreeing.count();
        self.refusal = match graph.frame() {
            None => Some(FixRefusal::Undetermined),
            Some(_) if (agreeing as f64) < LEAST_SHARE * taken as f64 => {
                Some(FixRefusal::Contradictory { agreeing, taken })
            }
            Some(_) => None,
        };
    }

    fn offset(&self, keyframes: &[Stamped]) -> Option<ClockOffset> {
        let place = |fix: &GnssFix| Pose::translation(fix.east_m, fix.north_m);
        let stamps = self.fixes.iter().map(|fix| fix.stamp_ns).collect();
        let fixes = Trajectory::timed(stamps, self.fixes.iter().map(place).collect());
        let lever = Pose::translation(self.lever_m.x, self.lever_m.y);
        let poses = keyframes.iter().map(|it| it.odometry * lever).collect();
        let stamps = keyframes.iter().map(|it| it.stamp_ns).collect();
        let antenna = Trajectory::timed(stamps, poses);
        let found = clock_offset(&fixes, &antenna)?;
        // A motion of the fixes at t equals the radar's motion at t + delay_s.
        Some(ClockOffset {
            delay_s: -found.delay_s,
            ..found
        })
        .filter(ClockOffset::is_reliable)
    }

    /// Returns whether an offset moves the vehicle by more than the noise of fixes.
    fn is_wrong(&self, clock: &ClockOffset, keyframes: &[Stamped]) -> bool {
        let path = Trajectory::untimed(keyframes.iter().map(|it| it.odometry).collect());
        let seconds = match keyframes {
            [first, .., last] => (last.stamp_ns - first.stamp_ns) as f64 * 1e-9,
            _ => return false,
        };
        let speed_mps = path.path_length_m() / seconds.max(f64::MIN_POSITIVE);
        let sigma_m = median(self.fixes.iter().map(|fix| fix.sigma_m)).unwrap_or_default();
        !clock.agrees() && clock.delay_s.abs() * speed_mps > CLOCK_SIGMAS * sigma_m
    }
}

/// Returns by how much a place between two keyframes may be off, if the vehicle does not move
/// evenly, m.
fn off_even(fix: &GnssFix, from: Stamped, to: Stamped) -> f64 {
    let [since_s, until_s] =
        [fix.stamp_ns - from.stamp_ns, to.stamp_ns - fix.stamp_ns].map(|ns| ns as f64 * 1e-9);
    0.5 * ACCELERATION_MPS2 * since_s * until_s
}
