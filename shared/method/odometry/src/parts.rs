//! The replaceable parts of the method: mask, search and refinement.

use gyre_geometry::Pose;
use gyre_masking::Masker;
use gyre_scan_matching::{ExhaustiveSearch, Refined, RefinementKind, Refiner};

use crate::{DecoupledSearch, Mask, OdometryConfig, Pair, Search, SearchKind, SetupError};

pub trait Refine: Send + Sync {
    fn refine(&mut self, pair: &Pair, searched: &Pose) -> Refined;

    /// Forgets all scans: the next one starts a new chain of motions.
    fn reset(&mut self);
}

/// The parts that an [`Odometry`](crate::Odometry) is composed of. Each part comes from the
/// configuration and can be replaced:
///
/// ```
/// use gyre_geometry::{SparsePoint, Twist};
/// use gyre_masking::Sweep;
/// use gyre_odometry::{Mask, Odometry, OdometryConfig, OdometryError, Parts, Rasters};
/// use gyre_radar::PolarScan;
/// use ndarray::s;
///
/// /// Masks the sector behind the vehicle, which contains its trailer.
/// struct WithoutTrailer(Box<dyn Mask>);
///
/// impl Mask for WithoutTrailer {
///     fn mask(
///         &mut self,
///         sweep: &Sweep<'_>,
///         rasters: &mut Rasters<'_>,
///     ) -> Result<Option<Twist>, OdometryError> {
///         let twist = self.0.mask(sweep, rasters)?;
///         let (rows, columns) = rasters.later.dim();
///         let behind = s![rows / 2.., columns / 2 - 5..columns / 2 + 6];
///         rasters.later.slice_mut(behind).fill(0.0);
///         Ok(twist)
///     }
///
///     fn points(
///         &mut self,
///         scan: &PolarScan<'_>,
///         twist: Option<Twist>,
///         out: &mut [SparsePoint],
///     ) -> Result<usize, OdometryError> {
///         let count = self.0.points(scan, twist, out)?;
///         for point in &mut out[..count] {
///             if point.x_m < 0.0 && point.y_m.abs() < 3.0 {
///                 point.weight = 0.0;
///             }
///         }
///         Ok(count)
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let config = OdometryConfig::default();
/// let mut parts = Parts::new(&config)?;
/// parts.masker = Box::new(WithoutTrailer(parts.masker));
/// let mut odometry = Odometry::with_parts(&config, parts);
/// # use gyre_simulator::{SimulationConfig, Simulator};
/// # let drive = Simulator::new(&SimulationConfig { scans: Some(1), ..SimulationConfig::default() })?;
/// # let scan = drive.render_scan(0).scan;
/// odometry.register(&scan.view(), &[])?;
/// assert!(odometry.raster().slice(s![128.., 122..133]).iter().all(|power| *power == 0.0));
/// assert!(odometry.raster().iter().any(|power| *power > 0.0));
/// # Ok(())
/// # }
/// ```
///
/// `examples/own_search.rs` replaces the search.
pub struct Parts {
    /// Makes masked rasters and points.
    pub masker: Box<dyn Mask>,
    /// Searches the motion between two masked scans.
    pub search: Box<dyn Search>,
    /// Refines the searched motion; `None`: it is the result.
    pub refiner: Option<Box<dyn Refine>>,
}

impl Parts {
    /// Makes the parts of a configuration, with all their buffers.
    pub fn new(config: &OdometryConfig) -> Result<Self, SetupError> {
        Ok(Self {
            masker: Box::new(Masker::new(
                &config.raster,
                &config.points,
                &config.masking,
            )?),
            refiner: refiner(config)?,
            search: search(config)?,
        })
    }
}

fn search(config: &OdometryConfig) -> Result<Box<dyn Search>, SetupError> {
    let (n, cell_m) = (config.raster.n, config.raster.cell_m.into());
    Ok(match config.search.kind {
        SearchKind::Decoupled => Box::new(DecoupledSearch::new(
            n,
            cell_m,
            &config.rotation,
            &config.translation,
        )?),
        SearchKind::Exhaustive => Box::new(ExhaustiveSearch::new(n, cell_m, &config.exhaustive)?),
    })
}

fn refiner(config: &OdometryConfig) -> Result<Option<Box<dyn Refine>>, SetupError> {
    let capacity = config.points.capacity;
    match config.refinement.kind {
        RefinementKind::None => Ok(None),
        RefinementKind::LocalMap if capacity == 0 => Err(SetupError::NoPoints),
        RefinementKind::LocalMap => {
            let refiner = Refiner::new(&config.refinement, capacity)?;
            let (gyro, wheels, doppler) = (&config.gyro, &config.wheels, &config.doppler);
            Ok(Some(Box::new(refiner.with_sensors(gyro, wheels, doppler))))
        }
    }
}

impl Refine for Refiner {
    fn refine(&mut self, pair: &Pair, searched: &Pose) -> Refined {
        let (later, earlier) = (pair.later_points(), pair.earlier_points());
        let interval_s = pair.interval_ns() as f64 * 1e-9;
        self.aiding = pair.aiding();
        Refiner::refine(self, pair.seq(), later, earlier, searched, interval_s)
    }

    fn reset(&mut self) {
        Refiner::reset(self);
    }
}
