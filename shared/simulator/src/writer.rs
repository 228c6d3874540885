//! Writes a simulated drive to a folder, on all processors. Resumes an interrupted one.

mod resume;

use std::fs::{self, File};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread::available_parallelism;

use gyre_datasets::{ImageSize, ImageSource as _};
use gyre_storage::{Draft, StorageError};

use crate::config::SimulationConfig;
use crate::error::SimulatorError;
use crate::simulated_drive::SimulatedDrive;

pub use resume::{MADE_BY, remove_dataset};

#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    pub scans: usize,
    pub kept: usize,
    /// Length of the path from the first scan to the last, metres (sum of the straight lines
    /// between scans).
    pub path_m: f64,
    pub duration_s: f64,
}

/// Writes the dataset of `config` to the folder `out` on all processors, on whose number the files
/// do not depend, and calls `progress(done, total)` for each image. Images of an earlier call with
/// the same configuration are kept; the first and the last of them are compared with newly rendered
/// ones.
pub fn write_dataset(
    config: &SimulationConfig,
    out: &Path,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Summary, SimulatorError> {
    let drive = SimulatedDrive::new(config)?;
    let images = out.join(drive.image_folder());
    fs::create_dir_all(&images).map_err(StorageError::at("write", &images))?;
    let _alone = lock(out)?;
    let missing = resume::missing(&drive, config, out)?;
    gyre_storage::write(&out.join(MADE_BY), resume::made_by(config)?)?;
    let options = resume::dataset_options(&drive)?;
    gyre_storage::write(&out.join(resume::DATASET_OPTIONS), options)?;
    write_side_files(&drive, out)?;
    let kept = drive.scans() - missing.len();
    progress(kept, drive.scans());
    let mut written = |done| progress(kept + done, drive.scans());
    write_images(&drive, &missing, &images, &mut written)?;
    Ok(summary(&drive, kept))
}

fn in_use(folder: &Path, other: &str) -> SimulatorError {
    SimulatorError::OtherFiles(format!(
        "{} holds `{other}`, which is no file of this dataset: choose an empty folder",
        folder.display()
    ))
}

fn lock(folder: &Path) -> Result<File, SimulatorError> {
    let failed = StorageError::at("write", folder);
    let handle = File::open(folder).map_err(&failed)?;
    match handle.try_lock() {
        Ok(()) => Ok(handle),
        Err(fs::TryLockError::WouldBlock) => Err(SimulatorError::Refused(format!(
            "another process is writing to {}: wait for it, or choose another folder",
            folder.display()
        ))),
        Err(fs::TryLockError::Error(source)) => Err(failed(source).into()),
    }
}

fn summary(drive: &SimulatedDrive, kept: usize) -> Summary {
    let simulator = drive.simulator();
    let last = simulator.scans() - 1;
    let step_m = |i: usize| {
        (simulator.pose(i).inverse() * simulator.pose(i + 1))
            .translation
            .vector
            .norm()
    };
    Summary {
        scans: simulator.scans(),
        kept,
        path_m: (0..last).map(step_m).sum(),
        duration_s: (simulator.time(last).start_us - simulator.time(0).start_us) as f64 * 1e-6,
    }
}

fn write_side_files(drive: &SimulatedDrive, out: &Path) -> Result<(), SimulatorError> {
    for (name, bytes) in drive.side_files() {
        let path = out.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(StorageError::at("write", folder))?;
        }
        gyre_storage::write(&path, &bytes)?;
    }
    Ok(())
}

/// Renders and writes the scans in `missing`; each thread takes the next one that is left.
fn write_images(
    drive: &SimulatedDrive,
    missing: &[usize],
    folder: &Path,
    progress: &mut dyn FnMut(usize),
) -> Result<(), SimulatorError> {
    let threads = available_parallelism().map_or(1, usize::from);
    let (next, size) = (AtomicUsize::new(0), drive.image_size());
    let (sender, results) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..threads.min(missing.len()) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                let mut renderer = drive.renderer();
                let (mut pixels, mut encoded) = (vec![0; size.bytes()], Vec::new());
                while let Some(&index) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                    renderer.draw(index, &mut pixels);
                    let path = folder.join(drive.image_name(index));
                    // The receiver outlives the threads.
                    let _ = sender.send(write_image(&path, size, &pixels, &mut encoded));
                }
            });
        }
        drop(sender);
        let mut outcome = Ok(());
        for (done, result) in results.iter().enumerate() {
            if result.is_err() && outcome.is_ok() {
                // No thread takes another scan; those in work are completed.
                next.store(missing.len(), Ordering::Relaxed);
                outcome = result;
            }
            progress(done + 1);
        }
        outcome
    })?;
    Ok(gyre_storage::sync_folder(folder)?)
}

/// Encodes the 8-bit grey PNG of `path` to `into`, whose content is replaced. Fast rather than
/// small: the difference to the neighbour in range compresses better than PNG's other filters and
/// needs no trial for each row (4 ms for an Oxford scan, which halves in size).
fn encode(
    path: &Path,
    size: ImageSize,
    pixels: &[u8],
    into: &mut Vec<u8>,
) -> Result<(), SimulatorError> {
    into.clear();
    let mut encoder = png::Encoder::new(into, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fastest);
    // In transposed images range runs downwards.
    encoder.set_filter(if size.height > size.width {
        png::Filter::Up
    } else {
        png::Filter::Sub
    });
    let encoded = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(pixels)?;
        writer.finish()
    });
    encoded.map_err(|error| {
        SimulatorError::Refused(format!("cannot encode {}: {error}", path.display()))
    })
}

/// Writes an image as a whole or not at all, whatever ends the process or the machine; `buffer` is
/// working memory.
fn write_image(
    path: &Path,
    size: ImageSize,
    pixels: &[u8],
    buffer: &mut Vec<u8>,
) -> Result<(), SimulatorError> {
    encode(path, size, pixels, buffer)?;
    let mut draft = Draft::create(path)?;
    draft.append(buffer)?;
    Ok(draft.commit()?)
}
