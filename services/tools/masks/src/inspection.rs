//! The effect of the mask on one scan.

use gyre_geometry::Twist;
use ndarray::Array2;

/// The column heads of [`Inspection::line`].
pub const HEADER: &str = "  scan   power %   above floor %   cells %   points %      m/s    deg/s";

/// Above this factor a cell or a point counts as kept.
const KEPT: f32 = 0.5;

/// A scan and its mask.
pub struct Inspection {
    /// The scan's place in the recording.
    pub number: usize,
    /// The raster of the scan; where the mask looks at two scans, then that of the scan before.
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

impl Inspection {
    /// Returns the shares that the mask keeps, in the columns of [`HEADER`].
    pub fn line(&self) -> String {
        let raster = &self.rasters[0];
        let masked = sum(&raster.masked);
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
            percent(masked, sum(&raster.whole)),
            percent(masked, raster.above_floor),
            kept(&mut raster.mask.iter().copied()),
            kept(&mut self.points.iter().map(|(_, factor)| *factor)),
            motion(|twist| twist.vx_mps),
            motion(|twist| twist.yaw_rate_radps.to_degrees()),
        )
    }
}

fn sum(cells: &Array2<f32>) -> f64 {
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
