//! Radar odometry in one process: the whole method on one page.
//!
//! [`Odometry::register`] is the method: compensate, rasterise, mask, rotate, translate, refine,
//! compose. The stages of a run consist of the same parts, so their motions are the same bits.
//!
//! # Frames and units
//! As in [`gyre_geometry`]: x forward, y left, yaw counter-clockwise; m, rad, s.

mod compensation;
mod config;
mod pair;
mod parts;
mod registered;
mod search;

use gyre_geometry::{
    ComposedMotion, LostAzimuths, OdometryMotion, PolarScan, SparsePoint, Twist, UncertainMotion,
    samples::{Sample, SampledSensors, Witness},
};
use gyre_masking::Masker;
use gyre_radar::{DopplerEstimator, LostAzimuthFinder, PlacedRows};
use ndarray::{ArrayView2, ArrayViewMut2};

use crate::{JointMatch, Refined, Refiner, Searched};
use compensation::LaggedTwists;

pub use config::{OdometryConfig, SearchConfig, SearchKind};
pub use pair::Pair;
pub use parts::Parts;
pub use registered::{OdometryError, Outcome, Registered, SetupError};
pub use search::{DecoupledSearch, Search};

/// Radar odometry. Registers scan after scan against the previous ones.
pub struct Odometry {
    masker: Masker,
    search: Box<dyn Search>,
    /// Has the map of the last keyframes; `None`: motions stay as searched.
    refiner: Option<Refiner>,
    /// The velocities of earlier scans, for motion compensation.
    twists: LaggedTwists,
    sensors: SampledSensors,
    doppler: Option<DopplerEstimator>,
    min_range_m: f32,
    finder: LostAzimuthFinder,
    /// Where azimuths of the last scan were lost, and a buffer for its rows at their bearings.
    lost: LostAzimuths,
    rows: PlacedRows,
    /// The scan that is being registered, and the one before it.
    pair: Pair,
    /// All motions so far: the pose in the frame of the first scan.
    driven: ComposedMotion,
}

impl Odometry {
    /// Allocates all buffers. After the first scan, registering a scan allocates nothing, except
    /// for a network, and for finding lost azimuths in a scan with more echoes than any before.
    pub fn new(config: &OdometryConfig) -> Result<Self, SetupError> {
        Ok(Self::with_parts(config, Parts::new(config)?))
    }

    /// Composes odometry of given parts, for a mask or a search of your own. The settings of these
    /// parts in the configuration have no effect.
    pub fn with_parts(config: &OdometryConfig, parts: Parts) -> Self {
        let (n, capacity) = (config.raster.n, config.points.capacity);
        Self {
            pair: Pair::new(n, capacity, parts.masker.scans()),
            masker: parts.masker,
            search: parts.search,
            refiner: parts.refiner,
            twists: LaggedTwists::new(config.masking.feedback_lag()),
            sensors: SampledSensors::new(&config.sensors),
            doppler: config
                .sensors
                .doppler
                .is_used()
                .then(DopplerEstimator::default),
            min_range_m: config.points.min_range_m,
            finder: LostAzimuthFinder::default(),
            lost: LostAzimuths::default(),
            rows: PlacedRows::default(),
            driven: ComposedMotion::default(),
        }
    }

    /// Registers the next scan: estimates its motion from the previous scan, and its pose. A scan
    /// that is not later than the previous one, or by more than [`gyre_geometry::MAX_INTERVAL_NS`],
    /// starts a new chain as after [`Odometry::restart`].
    ///
    /// `samples` are the gyro's and the wheels' samples that come with the scan
    /// ([`gyre_geometry::samples::interval_of`]), in the order of [`Sample::order`]; empty for
    /// radar alone. A scan that fails is skipped: the next scan is registered against the scan
    /// before it.
    pub fn register(
        &mut self,
        scan: &PolarScan<'_>,
        samples: &[Sample],
    ) -> Result<Registered, OdometryError> {
        scan.check()?;
        scan.check_times()?;
        if !self.pair.is_continued_at(scan.geometry.stamp_ns) {
            self.restart();
        }
        let (stamp_ns, span_ns) = (scan.geometry.stamp_ns, scan.span_ns());
        self.sensors.push(samples, stamp_ns, span_ns);
        self.pair.later.evidence = self.sensors.evidence();
        // The compensation needs a velocity before the search: an earlier one, turning as measured.
        let [_, twist] = self.sensors.with_yaw_rates([None, self.twists.next()]);
        let masked = self.mask(scan, twist);
        if masked.is_err() {
            // They would measure the next motion from the scan that is skipped.
            self.sensors.clear();
        }
        masked?;
        let searched = self.search()?;
        let refined = searched.as_ref().and_then(|motion| self.refine(motion));
        let registered = self.integrate(searched, refined);
        self.advance(&registered);
        Ok(registered)
    }

    /// Places the scan's azimuths if some were lost, rasterises it with motion compensation, masks
    /// it (Weston et al., Sec. III-E) and extracts its points.
    pub fn mask(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
    ) -> Result<(), OdometryError> {
        scan.check()?;
        self.lost = self.finder.find(scan, twist);
        let placed = self.rows.place(scan, &self.lost);
        self.pair.mask(&mut self.masker, &placed, twist)?;
        let doppler = self.doppler.as_mut();
        let velocity = doppler.and_then(|it| it.estimate(&placed, self.min_range_m).ok());
        self.pair.later.evidence[Witness::Doppler as usize] = velocity.unwrap_or_default();
        let variance_rad2 = self.lost.variance_of_mean_rad2(scan.geometry.azimuths);
        self.pair.later.azimuth_variance_rad2 = variance_rad2;
        Ok(())
    }

    /// Searches for the rotation (Weston et al., Eq. 7), then for the translation (Eq. 8) between
    /// the last two masked scans, or for both together by trying every angle; `None` where the
    /// chain starts.
    /// With rasters of [`Odometry::mask`], only a search of your own can fail.
    pub fn search(&mut self) -> Result<Option<JointMatch>, OdometryError> {
        self.search.search(&self.pair)
    }

    /// Refines the searched motion against the map of the last keyframes; `None` if no refinement
    /// is configured.
    pub fn refine(&mut self, searched: &JointMatch) -> Option<Refined> {
        let refiner = self.refiner.as_mut()?;
        let pair = &self.pair;
        let [earlier, later] = [&pair.earlier, &pair.later];
        Some(refiner.refine(&Searched {
            scan: pair.seq(),
            later: later.points(),
            earlier: earlier.points(),
            motion: searched.motion.pose(),
            interval_s: pair.interval_ns() as f64 * 1e-9,
            azimuth_variance_rad2: earlier.azimuth_variance_rad2 + later.azimuth_variance_rad2,
            evidence: [&earlier.evidence, &later.evidence],
        }))
    }

    /// Composes the motion with the pose (Checchin et al., Eqs. 1 and 2; see [`ComposedMotion`]).
    pub fn integrate(
        &mut self,
        searched: Option<JointMatch>,
        refined: Option<Refined>,
    ) -> Registered {
        let (motion, outcome) = estimate(searched.as_ref(), refined.as_ref());
        let motion = motion.normalized();
        self.driven = self.driven.then(&motion).normalized();
        Registered {
            seq: self.pair.seq(),
            motion,
            pose: self.driven.motion,
            outcome,
            interval_ns: self.pair.interval_ns(),
            searched,
            refined,
        }
    }

    /// Makes the registered scan the previous one, and its velocity the one for motion compensation
    /// of a later scan.
    pub fn advance(&mut self, registered: &Registered) {
        self.twists.push(registered.searched_twist());
        self.pair.advance();
    }

    /// Starts a new chain with the next scan; the pose stays.
    pub fn restart(&mut self) {
        self.pair.seq = 0;
        self.twists.clear();
        self.sensors.clear();
        self.finder.reset();
        if let Some(refiner) = &mut self.refiner {
            refiner.reset();
        }
    }

    /// Returns the mask's factors from 0 to 1, n x n, on the last scan (0) or on the one before (1,
    /// if the mask takes two). `None` without a network.
    pub fn factors(&self, scan: usize) -> Option<ArrayView2<'_, f32>> {
        self.masker.factors(scan)
    }

    /// Returns the raster of [`Odometry::mask`] before the search: n x n, row 0 far ahead.
    pub fn masked_mut(&mut self) -> ArrayViewMut2<'_, f32> {
        self.pair.later.raster.view_mut()
    }

    /// Returns the masked raster of the last registered scan, n x n, row 0 far ahead.
    pub fn raster(&self) -> ArrayView2<'_, f32> {
        self.pair.earlier.raster.view()
    }

    /// Returns the raster of the scan before the last one, masked for this pair, if the mask takes
    /// two scans.
    pub fn previous_raster(&self) -> Option<ArrayView2<'_, f32>> {
        self.pair.earlier_for_pair.as_ref().map(|it| it.view())
    }

    pub fn points(&self) -> &[SparsePoint] {
        self.pair.earlier_points()
    }

    /// Returns where azimuths of the last scan were lost. [`PlacedRows`] puts the rows behind these
    /// places to their estimated bearings.
    pub fn lost_azimuths(&self) -> LostAzimuths {
        self.lost
    }

    pub fn twist(&self) -> Option<Twist> {
        self.pair.earlier.twist
    }
}

fn estimate(searched: Option<&JointMatch>, refined: Option<&Refined>) -> (OdometryMotion, Outcome) {
    match (searched, refined) {
        (_, Some(refined)) => (refined.motion, refined.outcome.into()),
        (Some(found), None) => {
            let motion = UncertainMotion {
                motion: found.motion.pose(),
                covariance: found.motion.covariance,
            };
            (OdometryMotion::independent(motion), Outcome::Searched)
        }
        (None, None) => (OdometryMotion::default(), Outcome::Start),
    }
}
