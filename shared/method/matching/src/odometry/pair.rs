use gyre_geometry::{
    PolarScan, SparsePoint, Twist, continues,
    samples::{AllEvidence, Witness},
};
use gyre_masking::{Masker, Sweep};
use ndarray::{Array2, ArrayView2};

use crate::odometry::OdometryError;

/// Two consecutive scans: their masked rasters (n x n, row 0 far ahead) and their points.
pub struct Pair {
    pub(crate) later: Frame,
    pub(crate) earlier: Frame,
    /// The raster of the earlier scan, masked for this pair, if the mask takes two scans.
    pub(crate) earlier_for_pair: Option<Array2<f32>>,
    pub(crate) seq: u64,
}

pub(crate) struct Frame {
    stamp_ns: i64,
    pub twist: Option<Twist>,
    /// Variance of the mean azimuth of the rows: not zero if azimuths were lost at unknown places.
    pub azimuth_variance_rad2: f32,
    /// About the motion to this scan, by other sensors than the radar.
    pub evidence: AllEvidence,
    pub raster: Array2<f32>,
    points: Vec<SparsePoint>,
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

    /// Returns the turn between both scans by a gyro, rad; `None` if it was not measured.
    pub fn turn_rad(&self) -> Option<f64> {
        let turn = self.later.evidence[Witness::Gyro as usize].measured();
        turn.map(|turn| turn.value[0])
    }

    pub(crate) fn new(n: usize, capacity: usize, masked_scans: usize) -> Self {
        Self {
            later: Frame::new(n, capacity),
            earlier: Frame::new(n, capacity),
            earlier_for_pair: (masked_scans == 2).then(|| Array2::zeros((n, n))),
            seq: 0,
        }
    }

    /// Makes the scan the later one: masks it with motion compensation, and extracts its points.
    pub(crate) fn mask(
        &mut self,
        masker: &mut Masker,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
    ) -> Result<(), OdometryError> {
        let sweep = Sweep {
            number: self.seq,
            scan: *scan,
            twist,
        };
        let frame = &mut self.later;
        let follows = self.seq.checked_sub(1);
        let earlier = self.earlier_for_pair.as_mut().map(|r| r.view_mut());
        frame.twist = masker.mask(&sweep, follows, frame.raster.view_mut(), earlier)?;
        frame.count = masker.points(scan, frame.twist, &mut frame.points)?;
        frame.stamp_ns = scan.geometry.stamp_ns;
        Ok(())
    }

    /// Returns whether a scan at this time continues the chain of motions.
    pub(crate) fn is_continued_at(&self, stamp_ns: i64) -> bool {
        self.seq == 0 || continues(self.earlier.stamp_ns, stamp_ns)
    }

    pub(crate) fn advance(&mut self) {
        std::mem::swap(&mut self.later, &mut self.earlier);
        self.seq += 1;
    }
}

impl Frame {
    fn new(n: usize, capacity: usize) -> Self {
        Self {
            stamp_ns: 0,
            twist: None,
            azimuth_variance_rad2: 0.0,
            evidence: AllEvidence::default(),
            raster: Array2::zeros((n, n)),
            points: vec![SparsePoint::default(); capacity],
            count: 0,
        }
    }

    pub fn points(&self) -> &[SparsePoint] {
        &self.points[..self.count]
    }
}
