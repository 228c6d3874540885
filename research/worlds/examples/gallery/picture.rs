//! Scans as small pictures.

use std::ops::Range;

use gyre_geometry::OwnedScan;

/// Shades of grey: four bits a pixel keep a picture of noise small.
const SHADES: f64 = 15.0;
/// Default power of black, in counts: most noise is darker.
pub const BLACK: f64 = 8.0;

/// The part of a scan that is shown, and its grey scale.
#[derive(Clone)]
pub struct Frame {
    /// The part of the scan.
    pub part: Part,
    /// Columns and rows of pixels.
    pub size: (usize, usize),
    /// The powers of black and white, in the sensor's counts of half a decibel.
    pub shades: (f64, f64),
}

/// A part of a scan.
#[derive(Clone)]
pub enum Part {
    /// As measured: a row for each azimuth, range to the right, metres.
    Polar(Range<f64>, Range<f64>),
    /// A map around the sensor, ahead is up: half of its side, metres.
    Map(f64),
}

/// A grey picture.
pub struct Picture {
    size: (usize, usize),
    /// From 0 (black) to 1 (white), row by row.
    grey: Vec<f64>,
}

impl Frame {
    /// A polar picture of azimuths and ranges in metres.
    pub fn polar(azimuths: Range<f64>, range_m: Range<f64>) -> Self {
        Self {
            part: Part::Polar(azimuths, range_m),
            size: (240, 140),
            shades: (BLACK, 100.0),
        }
    }

    /// A map with half of its side in metres.
    pub fn map(half_m: f64) -> Self {
        Self {
            part: Part::Map(half_m),
            size: (190, 190),
            shades: (BLACK, 100.0),
        }
    }

    /// Sets the powers of black and white.
    pub fn shades(self, black: f64, white: f64) -> Self {
        Self {
            shades: (black, white),
            ..self
        }
    }

    /// Draws the mean of some scans.
    pub fn picture(&self, scans: &[OwnedScan]) -> Picture {
        let (black, white) = self.shades;
        let pixels =
            (0..self.size.1).flat_map(|row| (0..self.size.0).map(move |column| (column, row)));
        let power = |pixel| {
            scans
                .iter()
                .map(|scan| self.power(scan, pixel))
                .sum::<f64>()
                / scans.len() as f64
        };
        Picture {
            size: self.size,
            grey: pixels
                .map(|pixel| (power(pixel) - black) / (white - black))
                .collect(),
        }
    }

    fn power(&self, scan: &OwnedScan, (column, row): (usize, usize)) -> f64 {
        let (columns, rows) = (self.size.0 as f64, self.size.1 as f64);
        match &self.part {
            Part::Polar(azimuths, range_m) => {
                let span = |whole: &Range<f64>, at: usize, of: f64| {
                    let place =
                        |at: usize| whole.start + (whole.end - whole.start) * at as f64 / of;
                    place(at)..place(at + 1)
                };
                mean_power(
                    scan,
                    span(azimuths, row, rows),
                    span(range_m, column, columns),
                )
            }
            Part::Map(half_m) => {
                let metres = 2.0 * half_m / rows;
                let (ahead, right) = (
                    (0.5 * rows - row as f64) * metres,
                    (column as f64 - 0.5 * columns) * metres,
                );
                const PARTS: usize = 4;
                let part = |i: usize| (i as f64 + 0.5) / PARTS as f64 * metres;
                let parts =
                    (0..PARTS * PARTS).map(|i| (ahead - part(i / PARTS), right + part(i % PARTS)));
                parts
                    .map(|(ahead, right)| power_at(scan, ahead, right))
                    .sum::<f64>()
                    / (PARTS * PARTS) as f64
            }
        }
    }
}

/// Mean power of the bins within azimuths and ranges; that of the nearest bin if there is none.
fn mean_power(scan: &OwnedScan, azimuths: Range<f64>, range_m: Range<f64>) -> f64 {
    let indices = |span: Range<f64>| {
        let first = span.start.round() as i64;
        first..(span.end.round() as i64).max(first + 1)
    };
    let bins = indices(bin(scan, range_m.start)..bin(scan, range_m.end));
    let cells = indices(azimuths).flat_map(|azimuth| bins.clone().map(move |bin| (azimuth, bin)));
    let (sum, count) = cells.fold((0.0, 0.0), |(sum, count), cell| {
        (sum + power_in(scan, cell), count + 1.0)
    });
    sum / count
}

fn power_at(scan: &OwnedScan, ahead_m: f64, right_m: f64) -> f64 {
    let turn = scan.geometry.azimuths as f64 / std::f64::consts::TAU;
    let azimuth = (right_m.atan2(ahead_m) - f64::from(scan.azimuth_rad[0])) * turn;
    power_in(
        scan,
        (
            azimuth.round() as i64,
            bin(scan, ahead_m.hypot(right_m)).round() as i64,
        ),
    )
}

fn bin(scan: &OwnedScan, range_m: f64) -> f64 {
    (range_m - f64::from(scan.geometry.range_offset_m))
        / f64::from(scan.geometry.range_resolution_m)
        - 0.5
}

fn power_in(scan: &OwnedScan, (azimuth, bin): (i64, i64)) -> f64 {
    let azimuth = azimuth.rem_euclid(scan.geometry.azimuths as i64) as usize;
    usize::try_from(bin)
        .ok()
        .and_then(|bin| scan.view().row(azimuth).get(bin))
        .copied()
        .map_or(0.0, f64::from)
}

impl Picture {
    /// Pictures of one size, one below the other.
    pub fn stacked(pictures: &[Self]) -> Self {
        let (columns, rows) = pictures.first().map_or((0, 0), |first| first.size);
        let grey = pictures
            .iter()
            .flat_map(|picture| picture.grey.iter().copied());
        Self {
            size: (columns, rows * pictures.len()),
            grey: grey.collect(),
        }
    }

    /// A picture of any function of column and row.
    pub fn of(size: (usize, usize), grey: impl Fn(usize, usize) -> f64) -> Self {
        let grey = &grey;
        Self {
            size,
            grey: (0..size.1)
                .flat_map(|row| (0..size.0).map(move |column| grey(column, row)))
                .collect(),
        }
    }

    /// Marks rows at the left edge: white or black.
    pub fn with_margin(mut self, white: impl Fn(usize) -> bool) -> Self {
        const MARGIN: usize = 8;
        for (row, pixels) in self.grey.chunks_exact_mut(self.size.0).enumerate() {
            pixels[..MARGIN].fill(if white(row) { 1.0 } else { 0.0 });
            pixels[MARGIN..MARGIN + 2].fill(0.5);
        }
        self
    }

    /// The picture as a PNG of four bits a pixel.
    pub fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let shade = |grey: &f64| (grey.clamp(0.0, 1.0) * SHADES).round() as u8;
        let rows = self.grey.chunks_exact(self.size.0);
        let packed = rows
            .flat_map(|row| row.chunks(2))
            .map(|two| shade(&two[0]) << 4 | two.get(1).map_or(0, shade));
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.size.0 as u32, self.size.1 as u32);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Four);
        encoder.set_compression(png::Compression::High);
        encoder.set_filter(png::Filter::NoFilter);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&packed.collect::<Vec<u8>>())?;
        writer.finish()?;
        Ok(bytes)
    }
}
