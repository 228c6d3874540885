//! Small recordings of all formats, on disk.

use std::{fs, path::Path};

use gyre_datasets::Format;

/// Azimuths and range bins of an image.
const AZIMUTHS: usize = 16;
const BINS: usize = 40;
/// Columns of metadata.
const METADATA: usize = 11;
/// 2019-01-10 14:37:26 UTC, us.
const START_US: i64 = 1_547_131_046_000_000;
const PERIOD_US: i64 = 250_000;

pub struct Image {
    /// The name of the file, relative to the recording.
    pub name: String,
    /// Pixels a row.
    pub width: usize,
    /// Row by row.
    pub pixels: Vec<u8>,
}

pub struct Recording {
    pub format: Format,
    pub images: Vec<Image>,
    /// Texts beside them: names and contents.
    pub texts: Vec<(String, String)>,
}

impl Recording {
    /// A valid recording of three scans.
    pub fn of(format: Format) -> Self {
        let (middle, last) = (AZIMUTHS as i64 / 2 - 1, AZIMUTHS as i64 - 1);
        let (folder, named_row, unit) = match format {
            Format::Oxford => ("radar", 0, 1),
            Format::Oord => ("Navtech_CTS350-X_Radar", 0, 1),
            Format::Boreas | Format::BoreasRt => ("radar", middle, 1),
            Format::Mulran => ("sensor_data/radar/polar", last, 1000),
            Format::MulranOxfordForm => ("polar_oxford_form", last, 1000),
            Format::Radiate => ("Navtech_Polar", 0, 1),
            _ => ("navtech", 0, 1),
        };
        let transposed = matches!(format, Format::Mulran | Format::Radiate);
        let row_us = PERIOD_US / AZIMUTHS as i64;
        let image = |k: i64| {
            let start_us = START_US + k * PERIOD_US;
            let number = match format {
                Format::Radiate => format!("{:06}", k + 7),
                _ => ((start_us + named_row * row_us) * unit).to_string(),
            };
            let row = |row: i64| navtech_row((start_us + row * row_us) * unit, row);
            let pixels: Vec<u8> = match transposed {
                true => (0..AZIMUTHS * BINS).map(|i| (i * 7) as u8).collect(),
                false => (0..AZIMUTHS as i64).flat_map(row).collect(),
            };
            Image {
                name: format!("{folder}/{number}.png"),
                width: if transposed {
                    AZIMUTHS
                } else {
                    METADATA + BINS
                },
                pixels,
            }
        };
        Self {
            format,
            images: (0..3).map(image).collect(),
            texts: texts(format),
        }
    }

    /// Writes it into an empty folder.
    pub fn write(&self, folder: &Path) -> std::io::Result<()> {
        for image in &self.images {
            write(folder, &image.name, &image.png())?;
        }
        for (name, text) in &self.texts {
            write(folder, name, text.as_bytes())?;
        }
        Ok(())
    }
}

impl Image {
    pub fn png(&self) -> Vec<u8> {
        let mut file = Vec::new();
        let height = self.pixels.len() / self.width;
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, height as u32);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_compression(png::Compression::Fast);
        // Writing to memory cannot fail, and the pixels are whole rows.
        let written = encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&self.pixels));
        debug_assert!(written.is_ok());
        file
    }
}

/// Writes a file and the folders that lead to it.
pub fn write(folder: &Path, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let path = folder.join(name);
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent)?;
    }
    fs::write(path, bytes)
}

/// Stamp, encoder count, one byte of flags, powers.
fn navtech_row(stamp: i64, row: i64) -> Vec<u8> {
    let count = (13 + row * 5600 / AZIMUTHS as i64) as u16;
    let powers = (0..BINS as i64).map(|bin| (row * 31 + bin * 7) as u8);
    let mut bytes = stamp.to_le_bytes().to_vec();
    bytes.extend(count.to_le_bytes());
    bytes.push(255);
    bytes.extend(powers);
    bytes
}

fn texts(format: Format) -> Vec<(String, String)> {
    let options = format!(
        "format = \"{format}\"\nrange_resolution_m = 0.5\nrange_offset_m = -0.25\ndoppler_s = 0.04\n"
    );
    let mut texts = vec![("dataset.toml".to_owned(), options)];
    let lines = |line: &dyn Fn(i64) -> String| (0..3).map(line).collect::<String>();
    match format {
        Format::Oxford => {
            let line = |k: i64| format!("{} 1\n", START_US + k * PERIOD_US);
            texts.push(("radar.timestamps".to_owned(), lines(&line)));
        }
        Format::Radiate => {
            let line = |k: i64| {
                let (frame, ns) = (k + 7, 250_000_000 * k + 3_000_000);
                format!("Frame: {frame:06} Time: 1549986607.{ns}\n")
            };
            texts.push(("Navtech_Polar.txt".to_owned(), lines(&line)));
        }
        _ => {}
    }
    texts
}
