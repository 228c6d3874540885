//! The configuration of a recording that is played without a configuration file.
//!
//! The format gives the constants of the radar, which scans do not show: the constants in
//! `configs/NAME.toml`. Its scans give the threshold and the sizes of cells and beams.

use std::path::Path;

use gyre_datasets::{Dataset, DatasetOptions, Format, OpenError, ReadError};
use gyre_geometry::OwnedScan;
use thiserror::Error;
use toml::{Table, Value};

use crate::{ConfigurationError, MethodConfig, paths::Named, strict};

const SCANS: usize = 8;
/// The threshold above the noise floor, steps of half a decibel. Chosen on RADIATE and Oxford,
/// whose floors are 17 steps apart.
const ABOVE_NOISE: u8 = 36;
const CELLS: f32 = 255.0;
/// The largest cell, m: with it the rasters reach 102 m.
const MAX_CELL_M: f32 = 0.8;
/// From this time between scans on, the motion of the scan two before is too old for compensation,
/// s.
const LONG_PERIOD_S: f64 = 0.5;
/// Angle that a vehicle turns by in such a time, degrees.
const LONG_REACH_DEG: f64 = 45.0;

#[derive(Clone, Debug)]
pub struct Automatic {
    pub table: Table,
    pub sentence: String,
}

#[derive(Debug, Error)]
pub enum AutomaticError {
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("the recording has no scans")]
    Empty,
    /// The configuration of a recorded run, or constants of a radar that TOML cannot hold.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
}

/// Returns the settings of a recording from its format, its `dataset.toml` and its scans; for a
/// recorded run, the settings of the run. The options in `wished` override the format.
pub fn automatic(data: &Path, wished: &DatasetOptions) -> Result<Automatic, AutomaticError> {
    if gyre_recording::is_recording(data) {
        return of_recorded_run(data);
    }
    let dataset = radar_constants(data, wished)?;
    let measured = Measured::of(gyre_recording::open(data, &wished.or(&dataset))?.as_mut())?;
    let settings = measured.settings();
    let format = dataset
        .format
        .map_or_else(String::new, |format| format.to_string());
    let mut table = Table::new();
    let dataset = Value::try_from(dataset).map_err(|error| strict::value("dataset", error))?;
    table.insert("dataset".to_owned(), dataset);
    for sentence in &settings {
        strict::set(&mut table, sentence)?;
    }
    Ok(Automatic {
        table,
        sentence: format!(
            "no configuration is named: the radar's constants are those of {format}, and by its scans, with a noise floor of {}, {}",
            measured.noise,
            settings.join(", ")
        ),
    })
}

/// Returns the median power of some scans of a recording.
pub fn noise_floor(data: &Path, options: &DatasetOptions) -> Result<u8, AutomaticError> {
    Ok(Measured::of(gyre_recording::open(data, options)?.as_mut())?.noise)
}

/// The constants of a `dataset.toml` override the constants of its format. A recorded run has its
/// own.
pub fn radar_constants(
    data: &Path,
    wished: &DatasetOptions,
) -> Result<DatasetOptions, AutomaticError> {
    if gyre_recording::is_recording(data) {
        return Ok(DatasetOptions::default());
    }
    let format = gyre_recording::open(data, wished)?.format();
    Ok(DatasetOptions {
        format: Some(format),
        ..gyre_recording::stored_options(data)?.or(&constants(format)?)
    })
}

fn of_recorded_run(data: &Path) -> Result<Automatic, AutomaticError> {
    let recording = gyre_recording::open_recording(data)?;
    let parsed: Result<Table, toml::de::Error> = recording.head().configuration.parse();
    let mut table = parsed
        .map_err(|error| ConfigurationError(format!("the recording's configuration: {error}")))?;
    // The recording itself describes its scans.
    let sections = MethodConfig::sections();
    table.retain(|section, _| section != "dataset" && sections.contains(&section));
    let gnss = table.get_mut("gnss").and_then(Value::as_table_mut);
    let is_beside = |gnss: &&mut Table| {
        let kind = gnss.get("kind").and_then(Value::as_str);
        matches!(kind, Some("udp" | "ros2" | "auto"))
    };
    if let Some(gnss) = gnss.filter(is_beside) {
        // The fixes of the run lie beside it, if the run made the recording itself.
        gnss.insert("kind".to_owned(), "auto".into());
        gnss.remove("topic");
    }
    Ok(Automatic {
        table,
        sentence: "no configuration is named: that of the recorded run is used".to_owned(),
    })
}

fn constants(format: Format) -> Result<DatasetOptions, ConfigurationError> {
    let name = match format {
        Format::Oord | Format::Mcap | Format::Other | Format::Ros2Bag => {
            return Ok(DatasetOptions::default());
        }
        Format::MulranOxfordForm => Format::Mulran.name(),
        format => format.name(),
    };
    let mut table = Named::read_in(Path::new(name), None)?.table;
    strict::section(&mut table, "dataset")
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Measured {
    noise: u8,
    /// Depth of a range bin, m.
    range_resolution_m: f32,
    /// Range of the last bin, m.
    max_range_m: f32,
    /// Step between azimuths, degrees.
    step_deg: f32,
    /// Time between scans, s.
    period_s: f64,
}

impl Measured {
    fn of(dataset: &mut dyn Dataset) -> Result<Self, AutomaticError> {
        let mut scan = OwnedScan::with_limits(dataset.limits());
        let (mut counts, mut failure) = ([0_u64; 256], None);
        for index in (0..dataset.len()).step_by(dataset.len().div_ceil(SCANS).max(1)) {
            match dataset.read(index, scan.slot()) {
                Ok(geometry) => {
                    scan.geometry = geometry;
                    let rows = (0..geometry.azimuths).flat_map(|azimuth| scan.view().row(azimuth));
                    rows.for_each(|power| counts[usize::from(*power)] += 1);
                }
                Err(error) => failure = Some(error),
            }
        }
        let geometry = scan.geometry;
        match (median(&counts), failure) {
            (Some(noise), _) => Ok(Self {
                noise,
                range_resolution_m: geometry.range_resolution_m,
                max_range_m: geometry.range_resolution_m * geometry.bins as f32,
                step_deg: 360.0 / geometry.azimuths as f32,
                period_s: dataset.period_ns() as f64 * 1e-9,
            }),
            (None, Some(error)) => Err(error.into()),
            (None, None) => Err(AutomaticError::Empty),
        }
    }

    fn settings(&self) -> Vec<String> {
        let cell_m = (2.0 * self.max_range_m / CELLS)
            .min(MAX_CELL_M)
            .max(self.range_resolution_m);
        // In steps of 0.1 m: results do not depend on the last digits of a range resolution.
        let cell_m = (cell_m * 10.0 - 0.01).ceil() / 10.0;
        let mut settings = vec![
            format!("raster.cell_m={cell_m}"),
            format!(
                "masking.threshold={}",
                self.noise.saturating_add(ABOVE_NOISE).min(254)
            ),
            format!("points.range_cell_m={}", self.range_resolution_m.max(0.17)),
            format!("points.beam_deg={}", self.step_deg.max(2.7)),
        ];
        if self.period_s >= LONG_PERIOD_S {
            settings.push("masking.lag=1".to_owned());
            settings.push(format!("rotation.reach_deg={LONG_REACH_DEG}"));
        }
        settings
    }
}

/// Returns the upper median of values that are counted by value; `None` without any.
fn median(counts: &[u64; 256]) -> Option<u8> {
    let half = counts.iter().sum::<u64>() / 2;
    let mut below = 0;
    let middle = counts.iter().position(|count| {
        below += count;
        below > half
    });
    middle.and_then(|value| u8::try_from(value).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAVTECH: Measured = Measured {
        noise: 23,
        range_resolution_m: 0.0438,
        max_range_m: 165.0,
        step_deg: 0.9,
        period_s: 0.25,
    };

    #[test]
    fn the_usual_radar_gets_the_cells_of_its_own_configuration() {
        let expected = [
            "raster.cell_m=0.8",
            "masking.threshold=59",
            "points.range_cell_m=0.17",
            "points.beam_deg=2.7",
        ];
        assert_eq!(NAVTECH.settings(), expected);
        let radiate = Measured {
            max_range_m: 100.0,
            ..NAVTECH
        };
        assert_eq!(radiate.settings(), expected);
    }

    #[test]
    fn a_coarse_slow_radar_gets_cells_of_its_bins_and_beams_of_its_azimuths() {
        let coarse = Measured {
            noise: 4,
            range_resolution_m: 1.2,
            max_range_m: 100.0,
            step_deg: 3.0,
            period_s: 1.0,
        };
        let expected = [
            "raster.cell_m=1.2",
            "masking.threshold=40",
            "points.range_cell_m=1.2",
            "points.beam_deg=3",
            "masking.lag=1",
            "rotation.reach_deg=45",
        ];
        assert_eq!(coarse.settings(), expected);
    }

    #[test]
    fn each_format_has_constants_that_can_be_read() {
        for format in Format::OF_IMAGES {
            assert!(constants(*format).is_ok(), "{format}");
        }
        let radiate = constants(Format::Radiate).unwrap();
        assert_eq!(radiate.azimuth_eccentricity_rad, Some(0.0018));
    }

    #[test]
    fn the_median_is_that_of_the_counted_values() {
        let mut counts = [0; 256];
        assert_eq!(median(&counts), None);
        (counts[3], counts[9], counts[200]) = (2, 1, 1);
        assert_eq!(median(&counts), Some(9));
    }
}
