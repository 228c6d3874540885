//! A simulated drive as a recording of a format: images with their names, what lies beside them, and the truth. Where it goes, to a
//! disk or straight into a pipeline, is another's business.

use std::path::PathBuf;

use gyre_radar::{DatasetOptions, Format, ImageSize, ImageSource, OwnedScan, ScanSlot};

use crate::config::SimulationConfig;
use crate::error::SimulatorError;
use crate::layout::side_file::SideFile;
use crate::layout::{boreas, oxford, radiate};
use crate::output::{HostStamps, OutputFormat};
use crate::profile::Chirp;
use crate::profile::METADATA_BYTES;
use crate::sensor::Sensor;
use crate::simulator::Simulator;
use crate::truth;

/// A simulated drive as a recording.
#[derive(Clone)]
pub struct SimulatedDrive {
    simulator: Simulator,
    output: OutputFormat,
    host: HostStamps,
    seed: u64,
}

impl SimulatedDrive {
    /// Builds the town and the drive. Fails where the configuration makes no sense, or its format does not fit its radar.
    pub fn new(config: &SimulationConfig) -> Result<Self, SimulatorError> {
        let simulator = Simulator::new(config)?;
        let output = config.output.format.unwrap_or_default();
        if output == OutputFormat::Radiate {
            radiate::check(&simulator)?;
        }
        Ok(Self {
            simulator,
            output,
            host: config.output.host_stamps,
            seed: config.seed,
        })
    }

    /// What is recorded.
    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// The format that a reader of recordings will call it.
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

    /// How a reader is to read it so that ranges and angles come out as they were: this is what the radar knows of itself.
    pub fn dataset_options(&self) -> DatasetOptions {
        DatasetOptions {
            format: Some(self.format()),
            ..self.simulator.config().dataset_options()
        }
    }

    /// Scans.
    pub fn scans(&self) -> usize {
        self.simulator.scans()
    }

    /// The folder of images, below the recording's.
    pub fn image_folder(&self) -> &'static str {
        match self.output {
            OutputFormat::Oxford => oxford::FOLDER,
            OutputFormat::Boreas => boreas::FOLDER,
            OutputFormat::Radiate => radiate::FOLDER,
        }
    }

    /// An image's name.
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

    /// The scan's time as the format means it, nanoseconds since 1970.
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

    /// `ground_truth.tum`: the poses at the scans' times.
    pub fn ground_truth_tum(&self) -> Vec<u8> {
        truth::ground_truth_tum(
            &self.simulator,
            (0..self.scans())
                .map(|index| self.stamp_ns(index))
                .collect(),
        )
    }

    /// All that lies beside the images.
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
        files
    }

    fn stamps(&self) -> Option<String> {
        (self.output == OutputFormat::Radiate)
            .then(|| radiate::stamps(&self.simulator, self.host, self.seed))
    }

    /// A radar of one's own for this drive; several may measure at the same time.
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

/// Renders one image after the other, with the memory that takes.
pub struct Renderer {
    drive: SimulatedDrive,
    sensor: Sensor,
    scan: OwnedScan,
}

impl Renderer {
    /// What is rendered.
    pub fn drive(&self) -> &SimulatedDrive {
        &self.drive
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

    /// The same bytes whenever and on whatever thread it is called.
    fn draw(&mut self, index: usize, pixels: &mut [u8]) {
        let simulator = &self.drive.simulator;
        match self.drive.output {
            OutputFormat::Radiate => {
                let geometry =
                    simulator.render_into(index, &mut self.sensor, &mut self.scan.slot());
                radiate::lay_on_side(
                    &self.scan.bytes,
                    geometry.stride,
                    geometry.first_byte,
                    pixels,
                );
            }
            // Their images are what a sweep is rendered as.
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
