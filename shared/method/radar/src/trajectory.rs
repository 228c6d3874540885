use gyre_geometry::{Pose, interpolate};

/// Poses of the sensor (REP-103) in the world frame of the source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Time of each pose, ns (since 1970 in recordings), non-decreasing; `None` if the source has
    /// no times.
    pub stamp_ns: Option<Vec<i64>>,
    pub poses: Vec<Pose>,
}

impl Trajectory {
    /// Files round stamps by less than this: see [`Trajectory::near`].
    pub const ROUNDING_NS: u64 = 1_000_000;

    pub fn timed(stamps_ns: Vec<i64>, poses: Vec<Pose>) -> Self {
        let stamp_ns = Some(stamps_ns);
        Self { stamp_ns, poses }
    }

    pub fn untimed(poses: Vec<Pose>) -> Self {
        let stamp_ns = None;
        Self { stamp_ns, poses }
    }

    pub fn len(&self) -> usize {
        self.poses.len()
    }

    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Returns the stamps, empty if the source has no times.
    pub fn stamps(&self) -> &[i64] {
        self.stamp_ns.as_deref().unwrap_or_default()
    }

    pub fn path_length_m(&self) -> f64 {
        self.poses
            .windows(2)
            .map(|w| (w[1].translation.vector - w[0].translation.vector).norm())
            .sum()
    }

    /// Returns whether the poses have headings, rather than one constant value.
    pub fn has_heading(&self) -> bool {
        self.poses
            .windows(2)
            .any(|w| w[0].rotation != w[1].rotation)
    }

    pub fn span_ns(&self) -> Option<(i64, i64)> {
        let stamps = self.stamp_ns.as_ref()?;
        Some((*stamps.first()?, *stamps.last()?))
    }

    pub fn earlier_by(mut self, ns: i64) -> Self {
        for stamp in self.stamp_ns.iter_mut().flatten() {
            *stamp = stamp.saturating_sub(ns);
        }
        self
    }

    /// Returns the pose at a time, linearly interpolated. `None` outside the time span.
    pub fn at(&self, stamp_ns: i64) -> Option<Pose> {
        let stamps = self.stamp_ns.as_ref()?;
        let after = stamps.partition_point(|s| *s < stamp_ns);
        let (b, to) = (self.poses.get(after)?, *stamps.get(after)?);
        if to == stamp_ns {
            return Some(*b);
        }
        let (a, from) = (self.poses.get(after.checked_sub(1)?)?, stamps[after - 1]);
        let share = (stamp_ns - from) as f64 / (to - from) as f64;
        Some(interpolate(a, b, share))
    }

    /// As [`Trajectory::at`], but accepts times up to `tolerance_ns` outside the span, since files
    /// round stamps.
    pub fn near(&self, stamp_ns: i64, tolerance_ns: u64) -> Option<Pose> {
        let (first, last) = self.span_ns()?;
        let within = stamp_ns.clamp(first, last);
        self.at(within)
            .filter(|_| within.abs_diff(stamp_ns) <= tolerance_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn times_within_the_tolerance_are_clamped() {
        let poses = [1.0, 2.0, 4.0].map(|x| pose(x, 0.0, 0.0)).to_vec();
        let trajectory = Trajectory::timed(vec![0, 100, 150], poses);
        let x = |stamp_ns| trajectory.near(stamp_ns, 5).map(|pose| pose.translation.x);
        assert_eq!(
            [x(-6), x(-5), x(50), x(155), x(156)],
            [None, Some(1.0), Some(1.5), Some(4.0), None]
        );
    }
}
