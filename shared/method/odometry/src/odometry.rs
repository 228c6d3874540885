//! Odometry: from scans to motions and poses.

use gyre_geometry::{
    ComposedMotion, OdometryMotion, Pose, SparsePoint, Twist, UncertainMotion, pose,
};
use gyre_masking::{Masker, Sweep};
use gyre_radar::{PolarScan, continues};
use gyre_scan_matching::{
    ConfigError, ExhaustiveSearch, JointMatch, Refined, RefinementKind, Refiner,
    SequentialRotation, TranslationSearch,
};
use ndarray::{Array2, ArrayView2, ArrayViewMut2};

use crate::{
    OdometryConfig, OdometryError, Outcome, Registered, SearchKind, SetupError,
    compensation::LaggedTwists,
};

/// Radar odometry. Registers scan after scan against the previous ones.
pub struct Odometry {
    masker: Masker,
    search: Search,
    refiner: Option<Refiner>,
    twists: LaggedTwists,
    /// The scan that is being registered.
    current: Frame,
    /// The previous scan.
    previous: Frame,
    /// The raster of the previous scan, masked for this pair, if the mask takes two scans.
    previous_by_pair: Option<Array2<f32>>,
    /// Number of scans since the chain of motions started.
    seq: u64,
    driven: ComposedMotion,
}

/// The configured search.
enum Search {
    Decoupled(Box<SequentialRotation>, Box<TranslationSearch>),
    Exhaustive(Box<ExhaustiveSearch>),
}

/// The products of a scan.
struct Frame {
    stamp_ns: i64,
    twist: Option<Twist>,
    raster: Array2<f32>,
    points: Vec<SparsePoint>,
    /// Number of points in use.
    count: usize,
}

impl Odometry {
    /// Allocates all buffers. After the first scan, registering one allocates nothing but what a network does.
    ///
    /// # Errors
    /// The first setting out of its bounds; a network that cannot be used.
    pub fn new(config: &OdometryConfig) -> Result<Self, SetupError> {
        let masker = Masker::new(&config.raster, &config.points, &config.masking)?;
        let refiner = match config.refinement.kind {
            RefinementKind::None => None,
            RefinementKind::LocalMap if config.points.capacity == 0 => {
                return Err(SetupError::NoPoints);
            }
            RefinementKind::LocalMap => {
                Some(Refiner::new(&config.refinement, config.points.capacity)?)
            }
        };
        let n = config.raster.n;
        let frame = || Frame::new(n, config.points.capacity);
        Ok(Self {
            search: Search::new(config)?,
            refiner,
            twists: LaggedTwists::new(config.masking.feedback_lag()),
            current: frame(),
            previous: frame(),
            previous_by_pair: (masker.scans() == 2).then(|| Array2::zeros((n, n))),
            masker,
            seq: 0,
            driven: ComposedMotion::new(),
        })
    }

    /// Registers the next scan: estimates its motion from the previous scan, and its pose. A scan that is not later than the
    /// previous one, or by more than [`gyre_radar::MAX_INTERVAL_NS`], starts a new chain as after [`Odometry::restart`].
    ///
    /// # Errors
    /// A scan that cannot be used. It is skipped: the next scan is registered against the one before the error.
    pub fn register(&mut self, scan: &PolarScan<'_>) -> Result<Registered, OdometryError> {
        scan.check()?;
        scan.check_times()?;
        if self.seq > 0 && !continues(self.previous.stamp_ns, scan.geometry.stamp_ns) {
            self.restart();
        }
        let twist = self.twists.next();
        self.mask(scan, twist)?;
        let searched = self.search()?;
        let refined = searched.as_ref().and_then(|motion| self.refine(motion));
        Ok(self.integrate(searched, refined))
    }

    /// Rasterises the scan with motion compensation, masks it (Weston et al., Sec. III-E) and extracts its points.
    ///
    /// # Errors
    /// An inconsistent scan, or a network that fails.
    pub fn mask(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
    ) -> Result<(), OdometryError> {
        let sweep = Sweep {
            number: self.seq,
            scan: *scan,
            twist,
        };
        let frame = &mut self.current;
        let previous = self
            .previous_by_pair
            .as_mut()
            .map(|raster| raster.view_mut());
        let follows = self.seq.checked_sub(1);
        frame.twist = self
            .masker
            .mask(&sweep, follows, frame.raster.view_mut(), previous)?;
        frame.count = self.masker.points(scan, frame.twist, &mut frame.points)?;
        frame.stamp_ns = scan.geometry.stamp_ns;
        Ok(())
    }

    /// Searches for the rotation (Weston et al., Eq. 7), then for the translation (Eq. 8) between the last two masked scans,
    /// or for both together by trying every angle; `None` where the chain starts.
    ///
    /// # Errors
    /// None with rasters of [`Odometry::mask`].
    pub fn search(&mut self) -> Result<Option<JointMatch>, OdometryError> {
        let later = self.current.raster.view();
        let changed = self.previous_by_pair.is_some();
        let earlier = self
            .previous_by_pair
            .as_ref()
            .unwrap_or(&self.previous.raster);
        let earlier = (self.seq > 0).then(|| earlier.view());
        match &mut self.search {
            Search::Decoupled(rotation, translation) => {
                let rotation = rotation.next(self.seq, later, earlier, changed)?;
                let (Some(rotation), Some(earlier)) = (rotation, earlier) else {
                    return Ok(None);
                };
                let motion = translation.search(later, earlier, &rotation)?;
                Ok(Some(JointMatch { rotation, motion }))
            }
            Search::Exhaustive(search) => {
                let found = earlier.map(|earlier| search.search(later, earlier));
                Ok(found.transpose()?)
            }
        }
    }

    /// Refines the searched motion against the map of the last keyframes; `None` if no refinement is configured.
    pub fn refine(&mut self, searched: &JointMatch) -> Option<Refined> {
        let (motion, interval_s) = (motion_of(searched), self.interval_ns() as f64 * 1e-9);
        let (later, earlier) = (self.current.points(), self.previous.points());
        let refiner = self.refiner.as_mut()?;
        Some(refiner.refine(self.seq, later, earlier, &motion, interval_s))
    }

    /// Composes the motion with the pose (Checchin et al., Eqs. 1 and 2; see [`ComposedMotion`]), and makes the scan the previous one.
    pub fn integrate(
        &mut self,
        searched: Option<JointMatch>,
        refined: Option<Refined>,
    ) -> Registered {
        let interval_ns = self.interval_ns();
        let (motion, outcome) = match (&searched, &refined) {
            (_, Some(refined)) => (refined.motion, refined.outcome.into()),
            (Some(found), None) => {
                let motion = UncertainMotion {
                    motion: motion_of(found),
                    covariance: found.motion.covariance,
                };
                (OdometryMotion::independent(motion), Outcome::Searched)
            }
            (None, None) => (OdometryMotion::default(), Outcome::Start),
        };
        let motion = motion.normalized();
        self.driven = self.driven.then(&motion).normalized();
        let interval_s = interval_ns as f64 * 1e-9;
        self.twists.push(
            searched
                .as_ref()
                .map(|found| Twist::from_motion(&motion_of(found), interval_s)),
        );
        std::mem::swap(&mut self.current, &mut self.previous);
        self.seq += 1;
        Registered {
            seq: self.seq - 1,
            motion,
            pose: self.driven.motion(),
            outcome,
            interval_ns,
            searched,
            refined,
        }
    }

    /// Starts a new chain with the next scan; the pose stays.
    pub fn restart(&mut self) {
        self.seq = 0;
        self.twists.clear();
        if let Some(refiner) = &mut self.refiner {
            refiner.reset();
        }
    }

    /// Returns the masker, for its factors and the cells of points.
    pub fn masker(&self) -> &Masker {
        &self.masker
    }

    /// Returns the raster of [`Odometry::mask`] before the search: n x n, row 0 far ahead.
    pub fn masked_mut(&mut self) -> ArrayViewMut2<'_, f32> {
        self.current.raster.view_mut()
    }

    /// Returns the masked raster of the last registered scan, n x n, row 0 far ahead.
    pub fn raster(&self) -> ArrayView2<'_, f32> {
        self.previous.raster.view()
    }

    /// Returns the raster of the scan before the last one, masked for this pair, if the mask takes two scans.
    pub fn previous_raster(&self) -> Option<ArrayView2<'_, f32>> {
        self.previous_by_pair.as_ref().map(|raster| raster.view())
    }

    /// Returns the points of the last registered scan.
    pub fn points(&self) -> &[SparsePoint] {
        self.previous.points()
    }

    /// Returns the velocity with which the last registered scan was motion-compensated.
    pub fn twist(&self) -> Option<Twist> {
        self.previous.twist
    }

    fn interval_ns(&self) -> i64 {
        match self.seq {
            0 => 0,
            _ => self.current.stamp_ns.saturating_sub(self.previous.stamp_ns),
        }
    }
}

impl Search {
    fn new(config: &OdometryConfig) -> Result<Self, ConfigError> {
        let (n, cell_m) = (config.raster.n, config.raster.cell_m.into());
        Ok(match config.search.kind {
            SearchKind::Decoupled => Self::Decoupled(
                Box::new(SequentialRotation::new(n, &config.rotation)?),
                Box::new(TranslationSearch::new(n, cell_m, &config.translation)?),
            ),
            SearchKind::Exhaustive => Self::Exhaustive(Box::new(ExhaustiveSearch::new(
                n,
                cell_m,
                &config.exhaustive,
            )?)),
        })
    }
}

impl Frame {
    fn new(n: usize, capacity: usize) -> Self {
        Self {
            stamp_ns: 0,
            twist: None,
            raster: Array2::zeros((n, n)),
            points: vec![SparsePoint::default(); capacity],
            count: 0,
        }
    }

    fn points(&self) -> &[SparsePoint] {
        &self.points[..self.count]
    }
}

fn motion_of(found: &JointMatch) -> Pose {
    pose(found.motion.x_m, found.motion.y_m, found.motion.yaw_rad)
}
