//! The recording of a run with its lost azimuths put back, in RADIATE's form: so that others can be
//! run on the same scans.
//!
//! The places of the losses come from the run's journal, which keeps them with each pose.

use std::{
    fs,
    path::{Path, PathBuf},
};

use gyre_configuration::terminal::{Failure, print};
use gyre_datasets::{DatasetOptions, Format, LostAzimuthOption, find_ground_truth, stored_options};
use gyre_geometry::{LostAzimuths, OwnedScan};
use gyre_radar::lost::{repair, stale_rows};
use gyre_slam::mapping::encode_png;
use gyre_storage::{StorageError, create_folder, write as write_file};
use png::ColorType;

use crate::export::source::{Lost, Scans, Source};

/// The folder of the images in RADIATE's form; the list of their times lies beside it.
const IMAGES: &str = "Navtech_Polar";
const OPTIONS: &str = "dataset.toml";
/// The ends of the names of lists that lie beside the images.
const LISTS: [&str; 6] = ["csv", "json", "npy", "toml", "tum", "txt"];

pub fn write(source: &Source, out: &Path) -> Result<(), Failure> {
    let recording = recording(source)?;
    let images = recording
        .dataset
        .file(recording.played.start)
        .parent()
        .unwrap_or(Path::new(""))
        .to_owned();
    let mut writer = Writer {
        scan: OwnedScan::with_limits(recording.dataset.limits()),
        recording,
        found: source.lost()?,
        out: new_folder(out)?,
        scans: 0,
        repaired: 0,
        azimuths: 0,
        anywhere: 0,
    };
    while let Some(index) = writer.recording.next(&mut writer.scan, &mut 0)? {
        writer.write(index)?;
    }
    let root = images.parent().unwrap_or(Path::new(""));
    // Beside an interpolated column one of a standing radar may look stale.
    let options = DatasetOptions {
        lost_azimuths: Some(LostAzimuthOption::Ignore),
        ..stored_options(root)?
    };
    write_file(&out.join(OPTIONS), toml::to_string(&options)?)?;
    copy_lists(&images, root, out)?;
    let (out, scans, anywhere) = (out.display(), writer.scans, writer.anywhere);
    let (repaired, azimuths) = (writer.repaired, writer.azimuths);
    if anywhere > 0 {
        print::note(format_args!(
            "{anywhere} scans have lost azimuths but no pose, so that it is not known where: their azimuths are stretched over the whole turn"
        ));
    }
    print::line(format_args!(
        "{out}: {scans} scans, {repaired} of them repaired, which had lost {azimuths} azimuths"
    ))
}

fn recording(source: &Source) -> Result<Scans, Failure> {
    let Some(configuration) = &source.run else {
        return Err(
            "where azimuths were lost is known from a run: name the folder of its results".into(),
        );
    };
    let data = configuration.data();
    if configuration.simulation.is_some() {
        return Err(format!("the run was of {data}, which is not on disk: gyre simulate writes it, without lost azimuths if effects.lost_azimuths is false").into());
    }
    let Some(scans) = source.scans()? else {
        return Err("the run was of a radar, and has no scans: --record keeps them".into());
    };
    let format = scans.dataset.format();
    if format != Format::Radiate {
        return Err(format!("the scans of {data} are of the format `{format}`, and --format radiate repairs only those that are of RADIATE's").into());
    }
    if configuration.dataset.lost_azimuths == Some(LostAzimuthOption::Ignore) {
        return Err("the run has not looked for lost azimuths: run it again without dataset.lost_azimuths = \"ignore\"".into());
    }
    Ok(scans)
}

/// Creates the folder of a dataset and of its images, and returns the folder of the images.
fn new_folder(out: &Path) -> Result<PathBuf, Failure> {
    let is_free = !out.exists() || fs::read_dir(out).is_ok_and(|mut files| files.next().is_none());
    if !is_free {
        let out = out.display();
        return Err(format!("{out} exists: name a new folder, or remove it").into());
    }
    create_folder(out)?;
    let images = out.join(IMAGES);
    create_folder(&images)?;
    Ok(images)
}

struct Writer {
    recording: Scans,
    scan: OwnedScan,
    found: Lost,
    out: PathBuf,
    scans: usize,
    repaired: usize,
    azimuths: usize,
    /// Scans whose lost azimuths have unknown places.
    anywhere: usize,
}

impl Writer {
    fn write(&mut self, index: usize) -> Result<(), Failure> {
        let from = self.recording.dataset.file(index);
        let to = self.out.join(from.file_name().unwrap_or_default());
        let lost = stale_rows(&self.scan.view());
        self.scans += 1;
        if lost == 0 {
            return copy(from, &to);
        }
        self.repaired += 1;
        self.azimuths += lost;
        let places = match self.found.get(&(index as u64)) {
            // Anywhere, if live mode has dropped it.
            None => {
                self.anywhere += 1;
                LostAzimuths::anywhere(lost, self.scan.geometry.azimuths)
            }
            Some(found) if found.count() == lost => *found,
            Some(found) => {
                let (file, found) = (from.display(), found.count());
                return Err(format!("{file} has {lost} lost azimuths, and had {found} in the run: the recording has changed since").into());
            }
        };
        self.repair(&places, &to)
    }

    /// Writes the repaired scan, laid out as the file that it is from.
    fn repair(&self, places: &LostAzimuths, to: &Path) -> Result<(), Failure> {
        let scan = self.scan.view();
        let (azimuths, bins) = (scan.geometry.azimuths, scan.geometry.bins);
        let mut powers = vec![0; azimuths * bins];
        repair(&scan, places, &mut powers);
        if self.recording.dataset.is_transposed() {
            let by_range = (0..bins).flat_map(|bin| powers.iter().skip(bin).step_by(bins));
            powers = by_range.copied().collect();
        }
        write_grey(to, self.recording.dataset.image_size().width, &powers)
    }
}

/// Copies the ground truth and the lists beside the images. The times come last: images without
/// them are no recording, should this not come to its end.
fn copy_lists(images: &Path, root: &Path, out: &Path) -> Result<(), Failure> {
    let times = images.with_extension("txt");
    let failed = StorageError::at("read", root);
    let mut lists = Vec::new();
    for entry in fs::read_dir(root).map_err(&failed)? {
        lists.push(entry.map_err(&failed)?.path());
    }
    lists.retain(|path| {
        let end = path.extension().and_then(|end| end.to_str());
        let is_written = *path == times || path.ends_with(OPTIONS);
        path.is_file() && !is_written && end.is_some_and(|end| LISTS.contains(&end))
    });
    lists.extend(find_ground_truth(root));
    for list in lists {
        let to = out.join(list.strip_prefix(root)?);
        create_folder(to.parent().unwrap_or(out))?;
        copy(&list, &to)?;
    }
    copy(&times, &out.join(IMAGES).with_extension("txt"))
}

pub fn write_grey(path: &Path, width: usize, pixels: &[u8]) -> Result<(), Failure> {
    let picture = encode_png(width, ColorType::Grayscale, pixels)?;
    Ok(fs::write(path, picture).map_err(StorageError::at("write", path))?)
}

fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    fs::copy(from, to).map_err(StorageError::at("copy", from))?;
    Ok(())
}
