//! The scan that is being registered and the one before it.

use gyre_geometry::{SparsePoint, Twist};
use gyre_masking::Sweep;
use gyre_radar::{PolarScan, continues};
use gyre_samples::{DopplerVelocity, GyroTurn, WheelDistance};
use ndarray::{Array2, ArrayView2, ArrayViewMut2};

use crate::{Mask, OdometryError, Rasters};

/// Two consecutive scans: their masked rasters (n x n, row 0 far ahead) and their points.
pub struct Pair {
    later: Frame,
    earlier: Frame,
    /// The raster of the earlier scan, masked for this pair, if the mask takes two scans.
    earlier_for_pair: Option<Array2<f32>>,
    seq: u64,
    /// From the earlier scan to the later one.
    turn: Option<GyroTurn>,
    distance: Option<WheelDistance>,
}

/// The products of a scan.
struct Frame {
    stamp_ns: i64,
    twist: Option<Twist>,
    azimuth_variance_rad2: f32,
    velocity: Option<DopplerVelocity>,
    raster: Array2<f32>,
    points: Vec<SparsePoint>,
    /// Number of points in use.
    count: usize,
}

impl Pair {
    /// Returns the number of the later scan in its chain of motions, from 0. That one has no
    /// earlier scan.
    pub fn seq(&self) -> u64 {
        self.seq
    }

    pub fn later(&self) -> ArrayView2<'_, f32> {
        self.later.raster.view()
    }

    /// Returns the raster of the earlier scan; `None` where the chain of motions starts.
    pub fn earlier(&self) -> Option<ArrayView2<'_, f32>> {
        let alone = &self.earlier.raster;
        let raster = self.earlier_for_pair.as_ref().unwrap_or(alone);
        (self.seq > 0).then(|| raster.view())
    }

    /// Returns whether the earlier raster differs from the later raster of the pair before: the
    /// mask took two scans.
    pub fn earlier_changed(&self) -> bool {
        self.earlier_for_pair.is_some()
    }

    pub fn later_points(&self) -> &[SparsePoint] {
        self.later.points()
    }

    pub fn earlier_points(&self) -> &[SparsePoint] {
        self.earlier.points()
    }

    /// Returns the times of the earlier and of the later scan, ns; twice the later time where the
    /// chain of motions starts.
    pub fn stamps_ns(&self) -> [i64; 2] {
        let [earlier, later] = [&self.earlier, &self.later].map(|frame| frame.stamp_ns);
        match self.seq {
            0 => [later, later],
            _ => [earlier, later],
        }
    }

    pub fn interval_ns(&self) -> i64 {
        let [earlier, later] = self.stamps_ns();
        later.saturating_sub(earlier)
    }

    /// Returns the variance of the turn from the earlier scan to the later one due to the mean
    /// azimuths of both, rad²: not zero if azimuths were lost at unknown places.
    pub fn azimuth_variance_rad2(&self) -> f32 {
        self.earlier.azimuth_variance_rad2 + self.later.azimuth_variance_rad2
    }

    pub fn turn(&self) -> Option<GyroTurn> {
        self.turn
    }

    /// Sets the turn from the earlier scan to the one that comes.
    pub(crate) fn expect_turn(&mut self, turn: Option<GyroTurn>) {
        self.turn = turn;
    }

    pub fn distance(&self) -> Option<WheelDistance> {
        self.distance
    }

    /// Returns the velocities by Doppler of the earlier scan and of the later one; `None` if a scan
    /// does not determine it.
    pub fn velocities(&self) -> [Option<DopplerVelocity>; 2] {
        [self.earlier.velocity, self.later.velocity]
    }

    /// Sets the velocity by Doppler of the later scan.
    pub(crate) fn set_velocity(&mut self, velocity: Option<DopplerVelocity>) {
        self.later.velocity = velocity;
    }

    /// Sets the distance from the earlier scan to the one that comes.
    pub(crate) fn expect_distance(&mut self, distance: Option<WheelDistance>) {
        self.distance = distance;
    }

    pub(crate) fn new(n: usize, capacity: usize, masked_scans: usize) -> Self {
        Self {
            later: Frame::new(n, capacity),
            earlier: Frame::new(n, capacity),
            earlier_for_pair: (masked_scans == 2).then(|| Array2::zeros((n, n))),
            seq: 0,
            turn: None,
            distance: None,
        }
    }

    /// Makes the scan the later one: masks it with motion compensation, and extracts its points.
    pub(crate) fn mask(
        &mut self,
        masker: &mut dyn Mask,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
    ) -> Result<(), OdometryError> {
        let sweep = Sweep {
            number: self.seq,
            scan: *scan,
            twist,
        };
        let frame = &mut self.later;
        let mut rasters = Rasters {
            later: frame.raster.view_mut(),
            earlier: self.earlier_for_pair.as_mut().map(|r| r.view_mut()),
            follows: self.seq.checked_sub(1),
        };
        frame.twist = masker.mask(&sweep, &mut rasters)?;
        frame.count = masker.points(scan, frame.twist, &mut frame.points)?;
        frame.stamp_ns = scan.geometry.stamp_ns;
        Ok(())
    }

    /// Sets the variance of the mean azimuth of the later scan's rows, rad².
    pub(crate) fn expect_azimuth_errors(&mut self, variance_rad2: f32) {
        self.later.azimuth_variance_rad2 = variance_rad2;
    }

    /// Returns whether a scan at this time continues the chain of motions.
    pub(crate) fn is_continued_at(&self, stamp_ns: i64) -> bool {
        self.seq == 0 || continues(self.earlier.stamp_ns, stamp_ns)
    }

    /// Makes the later scan the earlier one.
    pub(crate) fn advance(&mut self) {
        std::mem::swap(&mut self.later, &mut self.earlier);
        self.seq += 1;
    }

    /// Makes the next scan the first of a chain of motions.
    pub(crate) fn restart(&mut self) {
        self.seq = 0;
    }

    pub(crate) fn later_mut(&mut self) -> ArrayViewMut2<'_, f32> {
        self.later.raster.view_mut()
    }

    /// Returns the raster of the earlier scan as it was masked when it was the later one.
    pub(crate) fn earlier_alone(&self) -> ArrayView2<'_, f32> {
        self.earlier.raster.view()
    }

    /// Returns the raster of the earlier scan that was masked for the pair, if the mask takes two
    /// scans.
    pub(crate) fn earlier_for_pair(&self) -> Option<ArrayView2<'_, f32>> {
        self.earlier_for_pair.as_ref().map(|raster| raster.view())
    }

    /// Returns the velocity for the motion compensation of the earlier scan.
    pub(crate) fn earlier_twist(&self) -> Option<Twist> {
        self.earlier.twist
    }
}

impl Frame {
    fn new(n: usize, capacity: usize) -> Self {
        Self {
            stamp_ns: 0,
            twist: None,
            azimuth_variance_rad2: 0.0,
            velocity: None,
            raster: Array2::zeros((n, n)),
            points: vec![SparsePoint::default(); capacity],
            count: 0,
        }
    }

    fn points(&self) -> &[SparsePoint] {
        &self.points[..self.count]
    }
}
