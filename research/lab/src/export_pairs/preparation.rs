//! From scans with true poses to records: the odometry's own rasters and searches, its motion
//! compensation by the truth.

use std::collections::VecDeque;

use gyre_configuration::{Configuration, terminal::Failure};
use gyre_geometry::{Pose, Twist, xy_yaw, PolarScan};
use gyre_masking::MaskKind;
use gyre_matching::{odometry::{Odometry, OdometryError, SearchConfig}, RefinementKind};
use half::{f16, slice::HalfFloatSliceExt};

/// A network masks what networks are trained on.
const LEARNED: &str = "masking.kind is `learned`, but masks are trained on rasters that no network has masked: \
                       set it to `threshold` or `none`";

/// Makes records of scans. Nothing is allocated once it is planned.
pub struct Preparation {
    odometry: Odometry,
    /// A sweep is compensated with the motion of the scan so many before; 0: not at all.
    lag: usize,
    rounded: Vec<f16>,
    /// The bytes of the last record.
    record: Vec<u8>,
    /// Times and true poses of the last `lag + 1` scans of the chain.
    chain: VecDeque<(i64, Pose)>,
}

impl Preparation {
    /// Plans rasters and searches.
    ///
    /// # Errors
    /// The first setting that is out of its bounds.
    pub fn new(configuration: &Configuration) -> Result<Self, Failure> {
        if configuration.odometry.masking.kind == MaskKind::Learned {
            return Err(LEARNED.into());
        }
        let mut config = configuration.odometry.clone();
        config.points.capacity = 0;
        config.search = SearchConfig::default();
        config.refinement.kind = RefinementKind::None;
        let lag = config.masking.feedback_lag();
        Ok(Self {
            odometry: Odometry::new(&config)?,
            lag,
            rounded: vec![f16::ZERO; config.raster.n * config.raster.n],
            record: Vec::new(),
            chain: VecDeque::with_capacity(lag + 2),
        })
    }

    /// Returns NumPy's description of a record, packed and little-endian, as in the table in
    /// [`super`].
    pub fn dtype(&self) -> String {
        let n = self.odometry.raster().nrows();
        format!(
            "[('raster', '<f2', ({n}, {n})), ('searched', '<f8', (3,)), ('pose', '<f8', (3,)), ('time_s', '<f8'), \
             ('twist', '<f4', (3,)), ('sequence', '<u4')]"
        )
    }

    /// Returns whether the next scan starts a chain.
    pub fn begins(&self) -> bool {
        self.chain.is_empty()
    }

    /// Starts a new chain with the next scan.
    pub fn begin(&mut self) {
        self.chain.clear();
        self.odometry.restart();
    }

    /// Returns the next scan's record. `pose` is the truth at the scan's time. After an error the
    /// chain is as it was.
    pub fn next(
        &mut self,
        scan: &PolarScan<'_>,
        pose: Pose,
        sequence: u32,
    ) -> Result<&[u8], OdometryError> {
        self.odometry.mask(scan, self.true_twist())?;
        // The file is what networks learn from, so the search sees the file's values.
        let mut raster = self.odometry.masked_mut();
        if let Some(cells) = raster.as_slice_mut() {
            self.rounded.convert_from_f32_slice(cells);
            self.rounded.convert_to_f32_slice(cells);
        }
        let found = self.odometry.search()?;
        let searched = found.map_or([f64::NAN; 3], |found| {
            [found.motion.x_m, found.motion.y_m, found.motion.yaw_rad]
        });
        let registered = self.odometry.integrate(found, None);
        self.odometry.advance(&registered);
        let stamp_ns = scan.geometry.stamp_ns;
        self.chain.push_back((stamp_ns, pose));
        if self.chain.len() > self.lag + 1 {
            self.chain.pop_front();
        }
        let twist = self.odometry.twist().unwrap_or_default();
        let twist = [twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps];
        let wide = [searched, xy_yaw(&pose)].concat().into_iter();
        let wide = wide
            .chain([stamp_ns as f64 * 1e-9])
            .flat_map(f64::to_le_bytes);
        let narrow = twist
            .into_iter()
            .flat_map(|value| (value as f32).to_le_bytes());
        self.record.clear();
        self.record
            .extend(self.rounded.iter().flat_map(|cell| cell.to_le_bytes()));
        self.record
            .extend(wide.chain(narrow).chain(sequence.to_le_bytes()));
        Ok(&self.record)
    }

    /// The true velocity of the scan `lag` before the next one.
    fn true_twist(&self) -> Option<Twist> {
        let ((from_ns, from), (to_ns, to)) = (self.chain.front()?, self.chain.get(1)?);
        let interval_s = to_ns.saturating_sub(*from_ns) as f64 * 1e-9;
        let twist = || Twist::from_motion(&(from.inverse() * to), interval_s);
        (self.chain.len() > self.lag).then(twist)
    }
}
