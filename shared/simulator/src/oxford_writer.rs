//! A simulated drive on disk, in the layout and the conventions of Oxford Radar RobotCar.
//!
//! `radar/<stamp>.png` (one a sweep, named by its first azimuth, microseconds), `radar.timestamps`, and
//! `gt/radar_odometry.csv`: for each scan but the first its pose in the frame of the one before, at the middles
//! of the sweeps, x forward, **y right, yaw clockwise**.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use crate::image::write_image;
use crate::sensor::{AZIMUTHS, STRIDE};
use crate::simulator::{Simulator, empty_scan};
use crate::{SimulationConfig, SimulatorError};

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The dataset's folder.
    pub folder: PathBuf,
    /// Scans written.
    pub scans: usize,
    /// Length of the path from the first scan to the last, metres (as a chain of straight motions).
    pub path_m: f64,
    /// Time from the first scan to the last, seconds.
    pub duration_s: f64,
}

/// Generates the dataset of `config` in the folder `out`, and calls `progress(done, total)` after each scan.
///
/// The files are the same, byte for byte, for the same configuration. Scans are rendered on all processors.
/// A folder with scans of another drive is refused; one with scans of the same drive is written again.
pub fn write_dataset(
    config: &SimulationConfig,
    out: &Path,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Summary, SimulatorError> {
    let simulator = Simulator::new(config)?;
    let images = out.join("radar");
    let truth = out.join("gt");
    for folder in [&images, &truth] {
        fs::create_dir_all(folder).map_err(SimulatorError::write(folder))?;
    }
    refuse_other_scans(&simulator, &images)?;
    write_text(&out.join("radar.timestamps"), &timestamps(&simulator))?;
    write_text(&truth.join("radar_odometry.csv"), &radar_odometry_csv(&simulator))?;
    write_images(&simulator, &images, progress)?;
    Ok(summary(&simulator, out))
}

fn summary(simulator: &Simulator, out: &Path) -> Summary {
    let last = simulator.scans() - 1;
    let step_m = |i: usize| (simulator.pose(i).inverse() * simulator.pose(i + 1)).translation.vector.norm();
    Summary {
        folder: out.to_owned(),
        scans: simulator.scans(),
        path_m: (0..last).map(step_m).sum(),
        duration_s: (simulator.time(last).start_us - simulator.time(0).start_us) as f64 * 1e-6,
    }
}

fn image_name(simulator: &Simulator, index: usize) -> String {
    format!("{}.png", simulator.time(index).start_us)
}

/// Fails if the folder holds a file that this dataset would not write.
fn refuse_other_scans(simulator: &Simulator, images: &Path) -> Result<(), SimulatorError> {
    let ours: std::collections::BTreeSet<String> = (0..simulator.scans()).map(|i| image_name(simulator, i)).collect();
    let mut others = Vec::new();
    for entry in fs::read_dir(images).map_err(SimulatorError::write(images))? {
        let name = entry.map_err(SimulatorError::write(images))?.file_name().to_string_lossy().into_owned();
        if !ours.contains(&name) {
            others.push(name);
        }
    }
    match others.into_iter().min() {
        Some(other) => Err(SimulatorError::OutputInUse { folder: images.to_owned(), other }),
        None => Ok(()),
    }
}

/// `radar.timestamps`: each sweep's name and whether it is valid.
fn timestamps(simulator: &Simulator) -> String {
    (0..simulator.scans()).map(|i| format!("{} 1\n", simulator.time(i).start_us)).collect()
}

/// `gt/radar_odometry.csv`: source is the newer scan, destination the older. With nine decimals where Oxford has six:
/// the truth is exact, and its chain should be.
fn radar_odometry_csv(simulator: &Simulator) -> String {
    let header = "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw,\
                  source_radar_timestamp,destination_radar_timestamp\n";
    let row = |newer: usize| {
        let (source, destination) = (simulator.time(newer), simulator.time(newer - 1));
        let motion = simulator.pose(newer - 1).inverse() * simulator.pose(newer);
        // From y left, yaw counter-clockwise to y right, yaw clockwise.
        let (x, y, yaw) = (motion.translation.x, -motion.translation.y, -motion.rotation.angle());
        format!(
            "{},{},{x:.9},{y:.9},{zero:.9},{zero:.9},{zero:.9},{yaw:.9},{},{}\n",
            source.middle_us(),
            destination.middle_us(),
            source.start_us,
            destination.start_us,
            zero = 0.0,
        )
    };
    std::iter::once(header.to_owned()).chain((1..simulator.scans()).map(row)).collect()
}

fn write_text(path: &Path, text: &str) -> Result<(), SimulatorError> {
    fs::write(path, text).map_err(SimulatorError::write(path))
}

/// Renders and writes all scans, each thread taking the next one that nobody has taken.
fn write_images(
    simulator: &Simulator,
    folder: &Path,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(), SimulatorError> {
    let total = simulator.scans();
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get()).min(total);
    let next = AtomicUsize::new(0);
    let (sender, results) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || work(simulator, folder, next, &sender));
        }
        drop(sender);
        let mut outcome = Ok(());
        for (done, result) in results.iter().enumerate() {
            if result.is_err() && outcome.is_ok() {
                // Nobody takes another scan; those under way end.
                next.store(total, Ordering::Relaxed);
                outcome = result;
            }
            progress(done + 1, total);
        }
        outcome
    })
}

fn work(simulator: &Simulator, folder: &Path, next: &AtomicUsize, results: &mpsc::Sender<Result<(), SimulatorError>>) {
    let (mut sensor, mut scan) = (simulator.sensor(), empty_scan());
    loop {
        let index = next.fetch_add(1, Ordering::Relaxed);
        if index >= simulator.scans() {
            return;
        }
        simulator.render_into(index, &mut sensor, &mut scan.slot());
        let written = write_image(&folder.join(image_name(simulator, index)), STRIDE, AZIMUTHS, &scan.bytes);
        if results.send(written).is_err() {
            return;
        }
    }
}
