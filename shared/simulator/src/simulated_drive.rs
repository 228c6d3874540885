//! A simulated drive in a dataset format: images with their names, side files and ground truth. It
//! can be written to a disk or streamed into a pipeline.

use std::{
    collections::VecDeque,
    mem,
    path::PathBuf,
    thread::{self, JoinHandle},
};

use gyre_datasets::{Dataset, DatasetOptions, Format, ImageSize, ImageSource, OpenError};
use gyre_geometry::{
    OwnedScan, ScanSlot,
    samples::{Sample, SampleKind},
};
use gyre_radar::Trajectory;

use crate::{
    beside::{self, KINDS, Kind, Record},
    config::SimulationConfig,
    error::SimulatorError,
    layout::{self, radiate},
    objects,
    output::OutputFormat,
    profile::{Chirp, METADATA_BYTES},
    sensor::Sensor,
    simulator::Simulator,
};

/// Images that are rendered ahead of the reader, which bounds the memory.
const AHEAD: usize = 6;
/// The renderers yield to the stages: on a vehicle the radar does their work.
const NICENESS: i32 = 10;

#[derive(Clone)]
pub struct SimulatedDrive {
    simulator: Simulator,
    output: OutputFormat,
}

impl SimulatedDrive {
    pub fn new(config: &SimulationConfig) -> Result<Self, SimulatorError> {
        let simulator = Simulator::new(config)?;
        let output = config.output.format.unwrap_or_default();
        if output == OutputFormat::Radiate {
            radiate::check(&simulator)?;
        }
        Ok(Self { simulator, output })
    }

    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

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

    pub fn dataset_options(&self) -> DatasetOptions {
        DatasetOptions {
            format: Some(self.format()),
            ..self.simulator.config().dataset_options()
        }
    }

    pub fn scans(&self) -> usize {
        self.simulator.scans()
    }

    pub fn image_folder(&self) -> &'static str {
        match self.output {
            OutputFormat::Oxford | OutputFormat::Boreas => "radar",
            OutputFormat::Radiate => "Navtech_Polar",
        }
    }

    pub fn image_name(&self, index: usize) -> String {
        match self.output {
            OutputFormat::Oxford => format!("{}.png", self.simulator.time(index).start_us),
            OutputFormat::Boreas => {
                format!("{}.png", layout::boreas_stamp_us(&self.simulator, index))
            }
            OutputFormat::Radiate => radiate::file_name(index),
        }
    }

    pub fn image_size(&self) -> ImageSize {
        let sampling = self.simulator.sampling();
        let [width, height] = match self.output {
            OutputFormat::Radiate => [sampling.azimuths, sampling.bins],
            _ => [METADATA_BYTES + sampling.bins, sampling.azimuths],
        };
        ImageSize { width, height }
    }

    /// The scan's time as the format defines it, nanoseconds since 1970.
    pub fn stamp_ns(&self, index: usize) -> i64 {
        let time = self.simulator.time(index);
        match self.output {
            OutputFormat::Oxford => {
                (time.start_us + time.stamp_us(self.simulator.sampling().azimuths - 1)) * 500
            }
            OutputFormat::Boreas => layout::boreas_stamp_us(&self.simulator, index) * 1000,
            OutputFormat::Radiate => radiate::stamp_ns(&self.simulator, index),
        }
    }

    fn stamps_ns(&self) -> Vec<i64> {
        (0..self.scans())
            .map(|index| self.stamp_ns(index))
            .collect()
    }

    pub fn ground_truth_tum(&self) -> Vec<u8> {
        let (simulator, stamps_ns) = (&self.simulator, self.stamps_ns());
        let pose = |stamp_ns: &i64| simulator.path().pose(simulator.drive_time_s(*stamp_ns));
        let poses = stamps_ns.iter().map(pose).collect();
        let stamp_ns = Some(stamps_ns);
        let mut text = Vec::new();
        // Writing to memory cannot fail, and there are stamps.
        let _ = gyre_datasets::write_tum(&Trajectory { stamp_ns, poses }, &mut text);
        text
    }

    /// The samples of a sensor beside the radar, by their stamps, as its log has them. `None` if
    /// the drive has no such sensor.
    pub fn samples(&self, kind: SampleKind) -> Option<Vec<Sample>> {
        beside::samples(kind, |row| self.records(row))
    }

    fn records(&self, kind: &Kind) -> Option<Vec<Record>> {
        self.simulator.records(kind)
    }

    pub(crate) fn side_files(&self) -> Vec<(&'static str, String)> {
        let simulator = &self.simulator;
        let mut files = match self.output {
            OutputFormat::Oxford => vec![
                ("radar.timestamps", layout::oxford_timestamps(simulator)),
                (
                    "gt/radar_odometry.csv",
                    layout::oxford_odometry_csv(simulator),
                ),
            ],
            OutputFormat::Boreas => vec![(
                "applanix/radar_poses.csv",
                layout::boreas_poses_csv(simulator),
            )],
            OutputFormat::Radiate => Vec::new(),
        };
        let truth = String::from_utf8_lossy(&self.ground_truth_tum()).into_owned();
        files.push(("ground_truth.tum", truth));
        let objects = objects::csv(simulator, &self.stamps_ns());
        files.push((objects::FILE, objects));
        files.extend(self.stamps().map(|text| ("Navtech_Polar.txt", text)));
        let log = |kind: &Kind| Some((kind.file, kind.csv(&self.records(kind)?)));
        files.extend(KINDS.iter().filter_map(log));
        files
    }

    fn stamps(&self) -> Option<String> {
        let is_radiate = self.output == OutputFormat::Radiate;
        is_radiate.then(|| radiate::stamps(&self.simulator))
    }

    /// Returns the azimuths of a scan that the host loses, in order: see
    /// [`SensorConfig::lost_azimuths`](crate::SensorConfig::lost_azimuths).
    pub fn lost_azimuths(&self, index: usize) -> Vec<usize> {
        radiate::lost_azimuths(&self.simulator, index)
    }

    pub fn renderer(&self) -> Renderer {
        Renderer {
            drive: self.clone(),
            sensor: self.simulator.sensor(),
            scan: OwnedScan::with_limits(self.simulator.limits()),
            ahead: None,
        }
    }

    /// Returns a renderer that renders the next images on all processors.
    pub(crate) fn renderer_ahead(&self) -> Renderer {
        Renderer {
            ahead: Some(Ahead::default()),
            ..self.renderer()
        }
    }

    /// Opens the drive as a dataset that lies on no disk, its images rendered ahead on all
    /// processors.
    pub fn open(&self, options: &DatasetOptions) -> Result<Box<dyn Dataset>, OpenError> {
        gyre_datasets::open_source(Box::new(self.renderer_ahead()), options)
    }
}

/// Renders images of a drive; owns the sensor and its working memory.
pub struct Renderer {
    drive: SimulatedDrive,
    sensor: Sensor,
    scan: OwnedScan,
    ahead: Option<Ahead>,
}

impl Renderer {
    fn render(&mut self, index: usize, pixels: &mut [u8]) {
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

    /// Loses azimuths of an image as the host does: the image before may have lost some too.
    fn lose_azimuths(&mut self, index: usize, pixels: &mut [u8]) {
        let azimuths = self.drive.lost_azimuths(index);
        if let Some(before) = index.checked_sub(1).filter(|_| !azimuths.is_empty()) {
            let mut recorded_before = vec![0; pixels.len()];
            self.render(before, &mut recorded_before);
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

    fn draw(&mut self, index: usize, pixels: &mut [u8]) {
        let ahead = self.ahead.as_mut();
        if !ahead.is_some_and(|ahead| ahead.take(&self.drive, index, pixels)) {
            self.render(index, pixels);
        }
    }
}

/// The images ahead of a reader, each rendered by a thread. They may be read in any order;
/// consecutive ones are fast. Since an image depends on its number alone, threads and their timing
/// change nothing.
#[derive(Default)]
struct Ahead {
    coming: VecDeque<(usize, JoinHandle<Vec<u8>>)>,
    /// A reader may need the first image only to inspect the recording.
    looked: bool,
}

impl Ahead {
    /// Copies image `index` to `pixels` as soon as it is rendered; false if the reader renders the
    /// image itself.
    pub fn take(&mut self, drive: &SimulatedDrive, index: usize, pixels: &mut [u8]) -> bool {
        if !mem::replace(&mut self.looked, true) {
            return false;
        }
        let goes_on = self.coming.front().is_some_and(|(at, _)| *at <= index);
        for (at, image) in mem::take(&mut self.coming) {
            match goes_on && at >= index {
                true => self.coming.push_back((at, image)),
                // Waits, or a reader that jumps would start ever more threads.
                false => drop(image.join()),
            }
        }
        let next = self.coming.back().map_or(index, |(last, _)| last + 1);
        for at in next..(index + AHEAD).min(drive.scans()) {
            self.coming.push_back((at, start(drive.clone(), at)));
        }
        let rendered = self.coming.pop_front().map(|(_, image)| image.join());
        if let Some(Ok(image)) = &rendered {
            pixels.copy_from_slice(image);
        }
        matches!(rendered, Some(Ok(_)))
    }
}

fn start(drive: SimulatedDrive, index: usize) -> JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        // On Linux this concerns this thread alone.
        let _ = rustix::process::nice(NICENESS);
        let mut pixels = vec![0; drive.image_size().bytes()];
        drive.renderer().draw(index, &mut pixels);
        pixels
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_read_in_any_order_are_those_rendered_alone() {
        let drive = SimulatedDrive::new(&SimulationConfig {
            scans: Some(12),
            ..SimulationConfig::default()
        })
        .unwrap();
        let (mut ahead, mut alone) = (drive.renderer_ahead(), drive.renderer());
        let (mut a, mut b) = (vec![0; ahead.size().bytes()], vec![0; ahead.size().bytes()]);
        for index in [0, 0, 1, 2, 9, 10, 3, 3, 5, 11] {
            ahead.draw(index, &mut a);
            alone.draw(index, &mut b);
            assert!(a == b, "image {index}");
        }
    }
}
