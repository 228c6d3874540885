//! A simulated drive in a dataset format: images with their names, side files and ground truth. It
//! can be written to a disk or streamed into a pipeline.

use std::path::PathBuf;

use gyre_datasets::{DatasetOptions, Format, ImageSize, ImageSource};
use gyre_geometry::{samples::{Sample, SampleKind}, OwnedScan, ScanSlot};
use gyre_simulator::beside::{KINDS, Kind};

use crate::{config::SimulationConfig, error::SimulatorError, layout::{side_file::SideFile, boreas, oxford, radiate}, objects, output::{HostStamps, OutputFormat}, profile::{Chirp, METADATA_BYTES}, sensor::{Sensor, effects::is_on}, simulator::Simulator, truth};

/// A simulated drive in a dataset format.
#[derive(Clone)]
pub struct SimulatedDrive {
    simulator: Simulator,
    output: OutputFormat,
    host: HostStamps,
    seed: u64,
}

impl SimulatedDrive {
    /// Builds the town and the path.
    ///
    /// # Errors
    /// As [`Simulator::new`]; [`SimulatorError::Config`] if the radar does not fit the format.
    pub fn new(config: &SimulationConfig) -> Result<Self, SimulatorError> {
        let simulator = Simulator::new(config)?;
        let output = config.output.format.unwrap_or_default();
        if output == OutputFormat::Radiate {
            radiate::check(&simulator)?;
        } else if is_on(config.effects.lost_azimuths) {
            return Err(SimulatorError::Config {
                key: "effects.lost_azimuths",
                value: "true".to_owned(),
                expected: "false but for output.format = \"radiate\": in other formats the azimuth of each row is written beside it".to_owned(),
            });
        }
        Ok(Self {
            simulator,
            output,
            host: config.output.host_stamps,
            seed: config.sensor_seed(),
        })
    }

    /// The simulator.
    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// The format as readers of datasets name it.
    pub fn format(&self) -> Format {
        match self.output {
            OutputFormat::Oxford => Format::Oxford,
            OutputFormat::Boreas if self.simulator.sampling().chirp == Chirp::Alternating => {
                Format::BoreasRt
            }
            OutputFormat::Boreas => Format::Boreas,
            OutputFormat::Radiate => Format::Radiate,
        }
    }

    /// Returns the options with which a reader gets the ranges and angles of the simulated radar.
    pub fn dataset_options(&self) -> DatasetOptions {
        DatasetOptions {
            format: Some(self.format()),
            ..self.simulator.config().dataset_options()
        }
    }

    /// Number of scans.
    pub fn scans(&self) -> usize {
        self.simulator.scans()
    }

    /// The folder of the images, relative to the dataset's.
    pub fn image_folder(&self) -> &'static str {
        match self.output {
            OutputFormat::Oxford => oxford::FOLDER,
            OutputFormat::Boreas => boreas::FOLDER,
            OutputFormat::Radiate => radiate::FOLDER,
        }
    }

    /// The name of an image.
    pub fn image_name(&self, index: usize) -> String {
        match self.output {
            OutputFormat::Oxford => oxford::file_name(&self.simulator, index),
            OutputFormat::Boreas => boreas::file_name(&self.simulator, index),
            OutputFormat::Radiate => radiate::file_name(index),
        }
    }

    /// Columns and rows of an image.
    pub fn image_size(&self) -> ImageSize {
        let sampling = self.simulator.sampling();
        match self.output {
            OutputFormat::Radiate => ImageSize {
                width: sampling.azimuths,
                height: sampling.bins,
            },
            _ => ImageSize {
                width: METADATA_BYTES + sampling.bins,
                height: sampling.azimuths,
            },
        }
    }

    /// The scan's time as the format defines it, nanoseconds since 1970.
    pub fn stamp_ns(&self, index: usize) -> i64 {
        let time = self.simulator.time(index);
        match self.output {
            OutputFormat::Oxford => {
                (time.start_us + time.stamp_us(self.simulator.sampling().azimuths - 1)) * 500
            }
            OutputFormat::Boreas => boreas::stamp_us(&self.simulator, index) * 1000,
            OutputFormat::Radiate => radiate::stamp_ns(&self.simulator, index),
        }
    }

    /// `ground_truth.tum`: the poses at the times of the scans.
    pub fn ground_truth_tum(&self) -> Vec<u8> {
        truth::ground_truth_tum(
            &self.simulator,
            (0..self.scans())
                .map(|index| self.stamp_ns(index))
                .collect(),
        )
    }

    /// The samples of a sensor beside the radar, by their stamps, as its log has them. `None` if
    /// the drive has no such sensor.
    pub fn samples(&self, kind: SampleKind) -> Option<Vec<Sample>> {
        self.simulator.samples(kind)
    }

    /// All files beside the images.
    pub(crate) fn side_files(&self) -> Vec<SideFile> {
        let mut files = match self.output {
            OutputFormat::Oxford => oxford::side_files(&self.simulator),
            OutputFormat::Boreas => boreas::side_files(&self.simulator),
            OutputFormat::Radiate => self
                .stamps()
                .map(|text| ("Navtech_Polar.txt".into(), text.into_bytes()))
                .into_iter()
                .collect(),
        };
        files.push(("ground_truth.tum".into(), self.ground_truth_tum()));
        files.push((
            "azimuth_poses.npy".into(),
            truth::azimuth_poses_npy(&self.simulator),
        ));
        let stamps_ns = (0..self.scans()).map(|index| self.stamp_ns(index));
        files.push((
            objects::FILE.into(),
            objects::csv(&self.simulator, stamps_ns),
        ));
        let log = |kind: &Kind| {
            let records = self.simulator.records(kind)?;
            Some((kind.file.into(), kind.csv(&records).into_bytes()))
        };
        files.extend(KINDS.iter().filter_map(log));
        files
    }

    fn stamps(&self) -> Option<String> {
        (self.output == OutputFormat::Radiate)
            .then(|| radiate::stamps(&self.simulator, self.host, self.seed))
    }

    /// Returns the azimuths of a scan that the host loses, in order: see
    /// [`Effects::lost_azimuths`](crate::Effects::lost_azimuths).
    pub fn lost_azimuths(&self, index: usize) -> Vec<usize> {
        match self.output {
            OutputFormat::Radiate => radiate::lost_azimuths(&self.simulator, self.seed, index),
            OutputFormat::Oxford | OutputFormat::Boreas => Vec::new(),
        }
    }

    /// Returns a new renderer; several can work at the same time.
    pub fn renderer(&self) -> Renderer {
        let (sensor, scan) = (
            self.simulator.sensor(),
            OwnedScan::with_limits(self.simulator.limits()),
        );
        Renderer {
            drive: self.clone(),
            sensor,
            scan,
        }
    }
}

/// Renders images of a drive; owns the sensor and its working memory.
pub struct Renderer {
    drive: SimulatedDrive,
    sensor: Sensor,
    scan: OwnedScan,
}

impl Renderer {
    /// The drive that is rendered.
    pub fn drive(&self) -> &SimulatedDrive {
        &self.drive
    }

    /// Loses azimuths of an image as the host does: the image before may have lost some too.
    fn lose_azimuths(&mut self, index: usize, pixels: &mut [u8]) {
        let azimuths = self.drive.lost_azimuths(index);
        if let Some(before) = index.checked_sub(1).filter(|_| !azimuths.is_empty()) {
            let mut recorded_before = vec![0; pixels.len()];
            self.draw(before, &mut recorded_before);
            let columns = self.drive.image_size().width;
            radiate::lose(pixels, &recorded_before, columns, &azimuths);
        }
    }
}

impl ImageSource for Renderer {
    fn format(&self) -> Format {
        self.drive.format()
    }

    fn size(&self) -> ImageSize {
        self.drive.image_size()
    }

    fn folder(&self) -> PathBuf {
        self.drive.image_folder().into()
    }

    fn files(&self) -> Vec<PathBuf> {
        let folder = self.folder();
        (0..self.drive.scans())
            .map(|index| folder.join(self.drive.image_name(index)))
            .collect()
    }

    fn stamps(&self) -> Option<String> {
        self.drive.stamps()
    }

    /// Gives the same bytes whenever and on whatever thread it is called.
    fn draw(&mut self, index: usize, pixels: &mut [u8]) {
        let simulator = &self.drive.simulator;
        match self.drive.output {
            OutputFormat::Radiate => {
                let geometry =
                    simulator.render_into(index, &mut self.sensor, &mut self.scan.slot());
                radiate::transpose(
                    &self.scan.bytes,
                    geometry.stride,
                    geometry.first_byte,
                    pixels,
                );
                self.lose_azimuths(index, pixels);
            }
            // An image of these formats is the sweep as it is rendered.
            OutputFormat::Oxford | OutputFormat::Boreas => {
                let mut slot = ScanSlot {
                    bytes: pixels,
                    ..self.scan.slot()
                };
                simulator.render_into(index, &mut self.sensor, &mut slot);
            }
        }
    }
}
