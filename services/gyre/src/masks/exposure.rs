//! What became of a scan: its raster with everything in it, the mask, what is left, and the points.

use gyre_geometry::{SparsePoint, Twist};
use gyre_masking::{MaskError, MaskKind, Masker, MaskerError, MaskingConfig};
use gyre_messages::MaskedHeader;
use thiserror::Error;

use super::chain::Link;
use crate::configuration::Configuration;

/// Above the lines of [`Exposure::line`].
pub const HEADER: &str = "  scan   power %   above floor %   cells %   points %      m/s    deg/s";

/// Above this factor a cell or a point counts as kept.
const KEPT: f32 = 0.5;

/// A scan and its mask.
pub struct Exposure {
    /// The scan's place in the recording.
    pub number: usize,
    /// Cells a side.
    pub n: usize,
    /// Its raster; where the mask looks at two scans, then that of the scan before.
    pub views: Vec<View>,
    /// Its points that lie in the raster: cell, and factor on the weight.
    pub points: Vec<(usize, f32)>,
    /// What its sweep's distortion was undone with.
    pub twist: Option<Twist>,
}

/// A raster before and after masking, row 0 far ahead.
pub struct View {
    /// All power, 0 to 255.
    pub whole: Vec<f32>,
    /// How much each cell counts, 0 to 1: nothing where no power is above the floor, else what the network says, if there is one.
    pub mask: Vec<f32>,
    /// What the search gets: power above the floor times the mask.
    pub masked: Vec<f32>,
    /// Power above the floor in all cells.
    pub above_floor: f64,
}

/// Why a scan cannot be shown.
#[derive(Debug, Error)]
pub enum ExposureError {
    /// Its raster.
    #[error(transparent)]
    Mask(#[from] MaskError),
    /// Its points.
    #[error(transparent)]
    Scan(#[from] gyre_radar::ScanError),
}

/// Makes again what a mask took away.
pub struct Exposer {
    n: usize,
    floor: u8,
    /// Without any mask, and without the network.
    bare: [Masker; 2],
    points: [Vec<SparsePoint>; 2],
}

impl Exposer {
    pub fn new(configuration: &Configuration) -> Result<Self, MaskerError> {
        let masker = |kind| {
            let masking = MaskingConfig {
                kind,
                ..configuration.masking.clone()
            };
            Masker::new(&configuration.raster, &configuration.points, &masking)
        };
        let floor = configuration.masking.floor();
        let points = vec![SparsePoint::default(); configuration.points.capacity];
        Ok(Self {
            n: configuration.raster.n,
            floor,
            bare: [
                masker(MaskKind::None)?,
                masker(if floor == 0 {
                    MaskKind::None
                } else {
                    MaskKind::Threshold
                })?,
            ],
            points: [points.clone(), points],
        })
    }

    /// Cells of a raster.
    pub fn cells(&self) -> usize {
        self.n * self.n
    }

    /// Shows the scan that `masker` had last, the first of `scans`, which became `masked` and was compensated by `twist`.
    pub fn expose(
        &mut self,
        masker: &mut Masker,
        scans: &[&Link],
        masked: &[f32],
        twist: Option<Twist>,
    ) -> Result<Exposure, ExposureError> {
        let places = masked.chunks(MaskedHeader::raster_values(self.cells()));
        let factors = (0..scans.len()).map(|scan| Some(&masker.factors()?[scan * self.cells()..]));
        let factors: Vec<Option<&[f32]>> = factors.collect();
        let views = scans
            .iter()
            .zip(places)
            .zip(factors)
            .map(|((scan, masked), factors)| self.view(scan, masked, factors));
        let views = views.collect::<Result<_, _>>()?;
        let points = self.points(masker, scans[0], twist)?;
        Ok(Exposure {
            number: scans[0].number,
            n: self.n,
            views,
            points,
            twist,
        })
    }

    fn view(
        &mut self,
        scan: &Link,
        masked: &[f32],
        factors: Option<&[f32]>,
    ) -> Result<View, MaskError> {
        let cells = self.cells();
        let [mut whole, mut above_floor] = [(); 2].map(|()| vec![0.0; cells]);
        for (masker, raster) in self.bare.iter_mut().zip([&mut whole, &mut above_floor]) {
            masker.mask(&scan.sweep(), None, raster)?;
        }
        let counts = |cell: usize| match self.floor == 0 || above_floor[cell] > 0.0 {
            true => factors.map_or(1.0, |factors| factors[cell]),
            false => 0.0,
        };
        let mask = (0..cells).map(counts).collect();
        Ok(View {
            whole,
            mask,
            masked: masked[..cells].to_vec(),
            above_floor: sum(&above_floor),
        })
    }

    /// Where the points are, and what the network makes of their weights.
    fn points(
        &mut self,
        masker: &mut Masker,
        scan: &Link,
        twist: Option<Twist>,
    ) -> Result<Vec<(usize, f32)>, ExposureError> {
        let [plain, weighed] = &mut self.points;
        let count = self.bare[1].points(&scan.sweep().scan, twist, plain)?;
        masker.points(&scan.sweep().scan, twist, weighed)?;
        let factor = |(plain, weighed): (&SparsePoint, &SparsePoint)| {
            Some((masker.cell_of(plain, twist)?, weighed.weight / plain.weight))
        };
        Ok(plain[..count]
            .iter()
            .zip(weighed.iter())
            .filter_map(factor)
            .collect())
    }
}

impl Exposure {
    /// What is kept, in figures: see [`HEADER`].
    pub fn line(&self) -> String {
        let view = &self.views[0];
        let masked = sum(&view.masked);
        let kept = |factors: &mut dyn Iterator<Item = f32>| {
            let (kept, all) = factors.fold((0, 0), |(kept, all), factor| {
                (kept + usize::from(factor > KEPT), all + 1)
            });
            percent(kept as f64, f64::from(all))
        };
        let motion = |figure: fn(Twist) -> f64| {
            self.twist
                .map_or_else(|| "-".to_owned(), |t| format!("{:.2}", figure(t)))
        };
        format!(
            "{:6} {:>9} {:>15} {:>9} {:>10} {:>8} {:>8}",
            self.number,
            percent(masked, sum(&view.whole)),
            percent(masked, view.above_floor),
            kept(&mut view.mask.iter().copied()),
            kept(&mut self.points.iter().map(|(_, factor)| *factor)),
            motion(|twist| twist.vx_mps),
            motion(|twist| twist.yaw_rate_radps.to_degrees()),
        )
    }
}

fn sum(cells: &[f32]) -> f64 {
    cells.iter().copied().map(f64::from).sum()
}

/// `-` of nothing.
fn percent(part: f64, whole: f64) -> String {
    if whole > 0.0 {
        format!("{:.1}", 100.0 * part / whole)
    } else {
        "-".to_owned()
    }
}
