//! Small generated datasets, and paths of real ones.
#![allow(dead_code, clippy::unwrap_used)]

use std::{
    fmt::Display,
    fs,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

/// 2019-01-10 14:37:26 UTC, us.
pub const START_US: i64 = 1_547_131_046_000_000;
pub const PERIOD_US: i64 = 250_000;

/// Asserts that something is refused in a sentence with these words.
#[track_caller]
pub fn assert_refused<T>(result: Result<T, impl Display>, words: &str) {
    let error = result
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(error.contains(words), "{words:?} is not in {error:?}");
}

/// Writes a text into a file of this name.
pub fn written(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, text).unwrap();
    path
}

/// The folder of real data; `None`, with a message, if the folder is missing.
pub fn real(folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("GYRE_DATA");
    if root.is_none() {
        println!("skipped: GYRE_DATA is not set");
    }
    Some(Path::new(&root?).join(folder))
}

pub fn write_png(path: &Path, width: usize, height: usize, pixels: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let file = std::io::BufWriter::new(fs::File::create(path).unwrap());
    let mut encoder = png::Encoder::new(file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(pixels).unwrap();
}

/// A sweep with Navtech metadata columns.
#[derive(Clone, Copy)]
pub struct Sweep {
    pub rows: usize,
    pub bins: usize,
    pub first_count: u16,
    pub step: u16,
    /// Encoder counts per turn.
    pub counts: usize,
    /// Stamp of the first row, and interval of the rows, in the unit of the file.
    pub start: i64,
    pub row_interval: i64,
    pub byte_ten: fn(usize) -> u8,
}

impl Default for Sweep {
    fn default() -> Self {
        Self {
            rows: 40,
            bins: 60,
            first_count: 13,
            step: 140,
            counts: 5600,
            start: START_US,
            row_interval: PERIOD_US / 40,
            byte_ten: |_| 255,
        }
    }
}

impl Sweep {
    /// A sweep with this first stamp.
    pub fn at(start: i64) -> Self {
        Self {
            start,
            ..Self::default()
        }
    }

    pub fn width(&self) -> usize {
        self.bins + 11
    }

    /// The power of every generated scan at a row and bin.
    pub fn power(row: usize, bin: usize) -> u8 {
        (row * 31 + bin * 7) as u8
    }

    pub fn pixels(&self) -> Vec<u8> {
        let mut pixels = Vec::with_capacity(self.rows * self.width());
        for row in 0..self.rows {
            let count = usize::from(self.first_count) + row * usize::from(self.step);
            pixels.extend((self.start + row as i64 * self.row_interval).to_le_bytes());
            pixels.extend(((count % self.counts) as u16).to_le_bytes());
            pixels.push((self.byte_ten)(row));
            pixels.extend((0..self.bins).map(|bin| Self::power(row, bin)));
        }
        pixels
    }

    pub fn write(&self, path: &Path) {
        write_png(path, self.width(), self.rows, &self.pixels());
    }
}

/// Writes `n` sweeps, each named by its start; `change` gives them other properties.
pub fn write_sweeps(folder: &Path, n: i64, change: impl Fn(i64, &mut Sweep)) {
    for k in 0..n {
        let mut sweep = Sweep::at(START_US + k * PERIOD_US);
        change(k, &mut sweep);
        sweep.write(&folder.join(format!("{}.png", sweep.start)));
    }
}

/// Writes `n` Oxford scans to `root/radar`, and returns their files in order.
pub fn write_oxford(root: &Path, n: i64) -> Vec<PathBuf> {
    let starts = || (0..n).map(|k| START_US + k * PERIOD_US);
    let list: String = starts().map(|start| format!("{start} 1\n")).collect();
    fs::create_dir_all(root.join("radar")).unwrap();
    fs::write(root.join("radar.timestamps"), list).unwrap();
    let write = |start| {
        let path = root.join(format!("radar/{start}.png"));
        Sweep::at(start).write(&path);
        path
    };
    starts().map(write).collect()
}

/// Writes `n` RADIATE scans of 60 bins x 40 azimuths, received at uniform times.
pub fn write_radiate(root: &Path, n: i64) -> Vec<PathBuf> {
    let (azimuths, bins) = (40, 60);
    let pixels: Vec<u8> = (0..bins * azimuths)
        .map(|i| Sweep::power(i % azimuths, i / azimuths))
        .collect();
    let line = |k: i64| {
        let ns = k * 250_000_000 + 3_000_000;
        let (s, ns) = (1_549_986_607 + ns / 1_000_000_000, ns % 1_000_000_000);
        format!("Frame: {:06} Time: {s}.{ns}\n", k + 7)
    };
    let list: String = (0..n).map(line).collect();
    fs::create_dir_all(root.join("Navtech_Polar")).unwrap();
    fs::write(root.join("Navtech_Polar.txt"), list).unwrap();
    let write = |k| {
        let path = root.join(format!("Navtech_Polar/{:06}.png", k + 7));
        write_png(&path, azimuths, bins, &pixels);
        path
    };
    (0..n).map(write).collect()
}
