//! Scans for the eye.

use std::{fs::File, io::BufWriter, path::Path};

use gyre_radar::{PolarScan, RasterConfig, RasterError, Rasteriser};
use ndarray::Array2;
use thiserror::Error;

/// A grey picture: powers as they are, 0 black.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub pixels: Vec<u8>,
}

/// Why a picture was not written.
#[derive(Debug, Error)]
#[error("cannot write the picture {path}: {source}", path = path.display())]
pub struct PictureError {
    /// The file.
    path: std::path::PathBuf,
    /// Why.
    source: png::EncodingError,
}

impl Picture {
    /// A scan from above, its whole range: ahead is up, left is left. Pixels of `cell_m`, so that several have the same scale.
    ///
    /// # Errors
    /// A scan that contradicts itself, a scale at which it would have more than 4096 pixels a side.
    pub fn from_above(scan: &PolarScan<'_>, cell_m: f32) -> Result<Self, RasterError> {
        let range_m = scan.geometry.bins as f32 * scan.geometry.range_resolution_m;
        let n = 2 * (range_m / cell_m) as usize + 1;
        let config = RasterConfig {
            n,
            cell_m,
            min_range_m: 0.0,
            ..RasterConfig::default()
        };
        let mut rasteriser = Rasteriser::new(&config)?;
        let mut cells = Array2::zeros((n, n));
        rasteriser.rasterise(scan, 0, None, cells.view_mut())?;
        Ok(Self {
            width: n,
            height: n,
            pixels: cells.iter().map(|power| power.round() as u8).collect(),
        })
    }

    /// A scan as it was measured: a row an azimuth, range to the right.
    pub fn as_measured(scan: &PolarScan<'_>) -> Self {
        let height = scan.geometry.azimuths;
        let pixels = (0..height)
            .flat_map(|azimuth| scan.row(azimuth))
            .copied()
            .collect();
        Self {
            width: scan.geometry.bins,
            height,
            pixels,
        }
    }

    /// Writes it as PNG.
    ///
    /// # Errors
    /// [`PictureError`] names the file.
    pub fn write(&self, path: &Path) -> Result<(), PictureError> {
        encode(
            path,
            [self.width, self.height],
            png::ColorType::Grayscale,
            &self.pixels,
        )
    }
}

/// Writes rows of red, green and blue as PNG.
///
/// # Errors
/// [`PictureError`] names the file.
pub fn write_rgb(path: &Path, width: usize, pixels: &[[u8; 3]]) -> Result<(), PictureError> {
    let size = [width, pixels.len() / width.max(1)];
    encode(path, size, png::ColorType::Rgb, pixels.as_flattened())
}

fn encode(
    path: &Path,
    [width, height]: [usize; 2],
    color: png::ColorType,
    bytes: &[u8],
) -> Result<(), PictureError> {
    let written = || {
        let file = BufWriter::new(File::create(path)?);
        let mut encoder = png::Encoder::new(file, width as u32, height as u32);
        encoder.set_color(color);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()
    };
    written().map_err(|source| PictureError {
        path: path.to_owned(),
        source,
    })
}
