//! Masks scans one after the other as a run does, and inspects the mask's effect on chosen ones.

use std::fmt;

use gyre_configuration::{
    Configuration, Played,
    terminal::{Failure, print},
};
use gyre_datasets::{Dataset, ScanSamples};
use gyre_geometry::{LostAzimuths, OwnedScan, SparsePoint, Twist};
use gyre_masking::{MaskKind, Masker, MaskingConfig, Sweep};
use gyre_matching::{
    RefinementConfig, RefinementKind,
    odometry::{Odometry, OdometryConfig},
};
use gyre_radar::PlacedRows;
use ndarray::Array2;
use serde::Serialize;

/// Scans registered before each inspected one where those are far apart. The first motions are
/// found without motion compensation, as at a run's start; a few scans later they equal a run's
/// motions, except for noise.
const RUN_UP: usize = 8;

pub struct MaskInspector {
    dataset: Box<dyn Dataset>,
    odometry: Odometry,
    lag: usize,
    next: usize,
    /// The last two registered scans, newest first, and memory to read the next one into.
    last: [Registered; 3],
    samples: ScanSamples,
    rows: PlacedRows,
    floor: u8,
    /// Maskers without any mask, and with the threshold alone.
    plain: [Masker; 2],
    points: Vec<SparsePoint>,
}

#[derive(Clone)]
struct Registered {
    scan: OwnedScan,
    /// The velocity that it was compensated with.
    twist: Option<Twist>,
    lost: LostAzimuths,
}

impl MaskInspector {
    pub fn new(configuration: &Configuration, played: Played) -> Result<Self, Failure> {
        let (dataset, samples) = (played.dataset, played.samples);
        let config = OdometryConfig {
            refinement: RefinementConfig {
                kind: RefinementKind::None,
                ..configuration.odometry.refinement.clone()
            },
            ..configuration.odometry.clone()
        };
        let floor = config.masking.floor();
        let threshold = match floor {
            0 => MaskKind::None,
            _ => MaskKind::Threshold,
        };
        let plain = |kind| {
            let masking = MaskingConfig {
                kind,
                ..config.masking.clone()
            };
            Masker::new(&config.raster, &config.points, &masking)
        };
        let last = Registered {
            scan: OwnedScan::with_limits(dataset.limits()),
            twist: None,
            lost: LostAzimuths::default(),
        };
        Ok(Self {
            odometry: Odometry::new(&config)?,
            lag: config.masking.feedback_lag(),
            next: configuration.source.played(dataset.scans()).start,
            last: [last.clone(), last.clone(), last],
            samples,
            rows: PlacedRows::default(),
            floor,
            plain: [plain(MaskKind::None)?, plain(threshold)?],
            points: vec![SparsePoint::default(); config.points.capacity],
            dataset,
        })
    }

    /// Advances to scan `number`, which is not before the last one, and inspects it; `None` if it
    /// cannot be read.
    pub fn inspect(&mut self, number: usize) -> Result<Option<Inspection>, Failure> {
        let from = number.saturating_sub(self.lag + RUN_UP);
        if from > self.next {
            self.next = from;
            self.odometry.restart();
        }
        for index in self.next..number {
            self.register(index)?;
        }
        self.next = number + 1;
        match self.register(number)? {
            true => self.inspection(number).map(Some),
            false => Ok(None),
        }
    }

    /// Registers a scan; false if it cannot be read and is left out, as in a run.
    fn register(&mut self, number: usize) -> Result<bool, Failure> {
        let next = &mut self.last[2];
        match self.dataset.read(number, next.scan.slot()) {
            Ok(geometry) => next.scan.geometry = geometry,
            Err(error) => {
                print::note(format_args!("left out: {error}"));
                return Ok(false);
            }
        }
        let scan = next.scan.view();
        let samples = self.samples.of(self.dataset.as_ref(), scan.span_ns());
        let registered = self.odometry.register(&scan, &samples);
        let registered = registered.map_err(|error| format!("scan {number}: {error}"))?;
        next.twist = self.odometry.twist();
        next.lost = self.odometry.lost_azimuths();
        self.last.rotate_right(1);
        if registered.seq == 0 {
            // Where the chain starts a scan is its own scan before.
            self.last[1] = self.last[0].clone();
        }
        Ok(true)
    }

    fn inspection(&mut self, number: usize) -> Result<Inspection, Failure> {
        let newest = self.odometry.raster().to_owned();
        let before = self.odometry.previous_raster();
        let before = before.map(|raster| raster.to_owned());
        let mut rasters = vec![self.masked_raster(0, newest)?];
        if let Some(before) = before {
            rasters.push(self.masked_raster(1, before)?);
        }
        Ok(Inspection {
            number,
            rasters,
            points: self.point_factors()?,
            twist: self.odometry.twist(),
        })
    }

    /// The raster of the last scan (0) or the one before (1), without and with its mask.
    fn masked_raster(&mut self, scan: usize, masked: Array2<f32>) -> Result<MaskedRaster, Failure> {
        let last = &self.last[scan];
        let sweep = Sweep {
            number: 0,
            scan: self.rows.place(&last.scan.view(), &last.lost),
            twist: last.twist,
        };
        let mut plain = [masked.clone(), masked.clone()];
        for (masker, raster) in self.plain.iter_mut().zip(&mut plain) {
            masker.mask(&sweep, None, raster.view_mut(), None)?;
        }
        let [whole, above_floor] = plain;
        let factors = self.odometry.factors(scan);
        // Nothing where no power is above the threshold, else the network's factor, if there is a
        // network.
        let mask = Array2::from_shape_fn(above_floor.dim(), |cell| {
            match self.floor == 0 || above_floor[cell] > 0.0 {
                true => factors.as_ref().map_or(1.0, |factors| factors[cell]),
                false => 0.0,
            }
        });
        Ok(MaskedRaster {
            whole,
            mask,
            masked,
            above_floor: above_floor.iter().copied().map(f64::from).sum(),
        })
    }

    /// The cell of each point of the last scan, and the factor of the mask on its weight.
    fn point_factors(&mut self) -> Result<Vec<([usize; 2], f32)>, Failure> {
        let twist = self.odometry.twist();
        let (masker, plain) = (&mut self.plain[1], &mut self.points);
        let last = &self.last[0];
        let scan = self.rows.place(&last.scan.view(), &last.lost);
        let count = masker.points(&scan, twist, plain)?;
        let points = plain[..count].iter().zip(self.odometry.points());
        let factor = |(plain, weighed): (&SparsePoint, &SparsePoint)| {
            Some((masker.cell_of(plain, twist)?, weighed.weight / plain.weight))
        };
        Ok(points.filter_map(factor).collect())
    }
}

pub const HEADER: &str = "  scan   power %   above floor %   cells %   points %      m/s    deg/s";

/// Above this factor a cell or a point counts as kept.
const KEPT: f32 = 0.5;

pub struct Inspection {
    pub number: usize,
    /// The raster of the scan; if the mask looks at two scans, then the raster of the scan before.
    pub rasters: Vec<MaskedRaster>,
    /// The points that lie in the raster: cell (row, column), and the factor of the mask on the
    /// weight.
    pub points: Vec<([usize; 2], f32)>,
    /// The velocity that its sweep was motion-compensated with.
    pub twist: Option<Twist>,
}

/// A raster before and after masking, n x n, row 0 far ahead.
pub struct MaskedRaster {
    /// All power, 0 to 255.
    pub whole: Array2<f32>,
    /// The weight of each cell, 0 to 1.
    pub mask: Array2<f32>,
    /// The input of the search: power above the threshold times the mask.
    pub masked: Array2<f32>,
    /// Power above the threshold in all cells.
    pub above_floor: f64,
}

/// The shares of a scan that the mask keeps, and its motion; `None`: of nothing.
#[derive(Serialize)]
pub struct Figures {
    scan: usize,
    power_percent: Option<f64>,
    above_floor_percent: Option<f64>,
    cells_percent: Option<f64>,
    points_percent: Option<f64>,
    forward_m_s: Option<f64>,
    yaw_rate_deg_s: Option<f64>,
}

impl Inspection {
    pub fn figures(&self) -> Figures {
        let raster = &self.rasters[0];
        let masked = sum(&raster.masked);
        let kept = |factors: Vec<f32>| {
            let kept = factors.iter().filter(|factor| **factor > KEPT).count();
            percent(kept as f64, factors.len() as f64)
        };
        Figures {
            scan: self.number,
            power_percent: percent(masked, sum(&raster.whole)),
            above_floor_percent: percent(masked, raster.above_floor),
            cells_percent: kept(raster.mask.iter().copied().collect()),
            points_percent: kept(self.points.iter().map(|(_, factor)| *factor).collect()),
            forward_m_s: self.twist.map(|twist| twist.vx_mps),
            yaw_rate_deg_s: self.twist.map(|twist| twist.yaw_rate_radps.to_degrees()),
        }
    }
}

impl fmt::Display for Figures {
    /// Writes the columns of [`HEADER`].
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:6}", self.scan)?;
        for (figure, width, digits) in [
            (self.power_percent, 9, 1),
            (self.above_floor_percent, 15, 1),
            (self.cells_percent, 9, 1),
            (self.points_percent, 10, 1),
            (self.forward_m_s, 8, 2),
            (self.yaw_rate_deg_s, 8, 2),
        ] {
            match figure {
                Some(figure) => write!(f, " {figure:>width$.digits$}")?,
                None => write!(f, " {:>width$}", "-")?,
            }
        }
        Ok(())
    }
}

fn sum(cells: &Array2<f32>) -> f64 {
    cells.iter().copied().map(f64::from).sum()
}

/// `None` of nothing.
fn percent(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| 100.0 * part / whole)
}
