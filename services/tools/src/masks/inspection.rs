//! The effect of the mask on one scan.

use std::fmt;

use gyre_geometry::Twist;
use ndarray::Array2;
use serde::Serialize;

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
