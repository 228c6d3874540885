//! Detection of the format of a folder: by its layout, otherwise by the first image.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::error::OpenError;
use super::first_image::FirstImage;
use super::format::Format;
use super::image_list::has_png;
use super::images::{ImageSource, Images};
use super::profiles::{KNOWN, Known, Profile};

pub(crate) struct Found {
    pub(crate) format: Format,
    pub(crate) folder: PathBuf,
    pub(crate) images: Images,
    /// Sentences on files that are left out, and on the format, if it was detected from the first
    /// image.
    pub(crate) notes: Vec<String>,
    /// The list of stamps, if it is not in a file.
    pub(crate) stamps: Option<String>,
}

impl Found {
    fn new(format: Format, folder: PathBuf, images: Images) -> Self {
        Self {
            format,
            folder,
            images,
            notes: Vec::new(),
            stamps: None,
        }
    }

    pub(crate) fn listed(
        root: &Path,
        format: Format,
        files: Vec<PathBuf>,
    ) -> Result<Self, OpenError> {
        let folder = files.first().and_then(|file| file.parent()).unwrap_or(root);
        let folder = folder.to_owned();
        let images = Images::listed(&folder, files)?;
        Ok(Self::new(format, folder, images))
    }

    pub(crate) fn source(
        source: Box<dyn ImageSource>,
        forced: Option<Format>,
    ) -> Result<Self, OpenError> {
        let format = forced.unwrap_or(source.format());
        let (folder, stamps) = (source.folder(), source.stamps());
        Ok(Self {
            stamps,
            ..Self::new(format, folder, Images::of(source)?)
        })
    }
}

const SET_FORMAT: &str = "if it is one, set its `format`";

/// Returns whether a folder has images where a dataset has them.
pub fn is_dataset(root: &Path) -> bool {
    let mut folders = KNOWN.iter().flat_map(|(_, folders, _)| *folders);
    folders.any(|folder| has_png(&root.join(folder)))
}

/// Returns whether a folder has the name of a known folder of images.
pub(crate) fn is_folder_of_images(folder: &Path) -> bool {
    let name = folder.file_name().and_then(|name| name.to_str());
    name.is_some_and(|name| known_by_name(name).is_some())
}

fn known_by_name(name: &str) -> Option<&'static Known> {
    let is_of = |folder: &&str| Path::new(folder).ends_with(name);
    let mut known = KNOWN.iter();
    known.find(|(_, folders, _)| folders.iter().any(is_of))
}

pub(crate) fn locate(root: &Path, forced: Option<Format>) -> Result<Found, OpenError> {
    check_folder(root)?;
    let folder = find_folder(root, forced);
    let folder = folder.map_err(|error| other_format(root, forced).unwrap_or(error))?;
    let (mut images, mut notes) = Images::open(&folder)?;
    if let Some(format) = forced
        && let Ok(Some(image)) = FirstImage::read(&mut images)
        && (is_other_form(format, &image) || is_marked_otherwise(format, &image, root, &folder))
    {
        other_format(root, forced).map_or(Ok(()), Err)?;
    }
    let format = match forced.or_else(|| by_layout(root, &folder)) {
        Some(format) => format,
        None => {
            let (format, evidence) = by_image(root, &folder, &mut images)?;
            notes.push(format!(
                "The layout of the folder matches no dataset; read as {format} by its first image: {evidence}"
            ));
            format
        }
    };
    Ok(Found {
        notes,
        ..Found::new(format, folder, images)
    })
}

fn is_other_form(format: Format, image: &FirstImage) -> bool {
    let has_stamps = !matches!(format, Format::Mulran | Format::Radiate);
    image.has_stamps() != has_stamps
}

/// Returns whether both the names of images and the files beside them belong to a different format.
/// A recording of one's own may differ in either.
fn is_marked_otherwise(format: Format, image: &FirstImage, root: &Path, folder: &Path) -> bool {
    let profile = Profile::of(format).filter(|it| it.bins.is_some());
    let is_named_otherwise = profile
        .zip(image.named_by())
        .is_some_and(|(profile, by)| profile.named_by != by);
    // The names of folders are weaker evidence: `navtech` may hold anything.
    let has_oxford_files = by_layout(root, folder) == Some(Format::Oxford);
    let by_files = has_oxford_files && format != Format::Oxford;
    is_named_otherwise && (by_files || (has_boreas_folders(root) && !is_boreas(format)))
}

fn is_boreas(format: Format) -> bool {
    matches!(format, Format::Boreas | Format::BoreasRt)
}

fn has_boreas_folders(root: &Path) -> bool {
    ["applanix", "calib"].iter().any(|f| root.join(f).is_dir())
}

fn other_format(root: &Path, configured: Option<Format>) -> Option<OpenError> {
    let (configured, found) = (configured?, locate(root, None).ok()?.format);
    let fault = format!(
        "looks like {found}, but the configuration has `format = \"{configured}\"`: use a configuration of {found}, or none"
    );
    (found != configured).then(|| OpenError::at(root, fault))
}

fn check_folder(root: &Path) -> Result<(), OpenError> {
    match fs::metadata(root) {
        Ok(entry) if entry.is_dir() => Ok(()),
        Ok(_) => {
            let fault = "is a file: give the folder of the dataset, which holds the radar images or their folder (unpack an archive before), or a recording or bag of ROS 2 as MCAP (`rosbags-convert` of `pip install rosbags` makes it of a bag of ROS 1)";
            Err(OpenError::at(root, fault))
        }
        Err(e) if e.kind() == ErrorKind::NotFound => Err(OpenError::Recording(format!(
            "there is no dataset at {}: no such folder; check the path",
            root.display()
        ))),
        Err(source) => Err(OpenError::io(root, source)),
    }
}

/// Returns the folder of the images: the folder of a known layout, otherwise the root.
fn find_folder(root: &Path, forced: Option<Format>) -> Result<PathBuf, OpenError> {
    let known = || {
        let of_format = |(format, ..): &&Known| forced.is_none_or(|forced| forced == *format);
        let known = KNOWN.iter().filter(of_format);
        known.flat_map(|(_, folders, _)| folders.iter())
    };
    let mut candidates = known().map(|folder| root.join(folder));
    if let Some(folder) = candidates.clone().find(|folder| has_png(folder)) {
        return Ok(folder);
    }
    if has_png(root) {
        // `.` and `..` hide the name of the folder, beside which some formats store their stamps.
        return Ok(fs::canonicalize(root).unwrap_or_else(|_| root.to_owned()));
    }
    // An empty folder of a known layout is more informative than the root.
    if let Some(folder) = candidates.find(|folder| folder.is_dir()) {
        return Err(OpenError::no_images(&folder));
    }
    if fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_none()) {
        return Err(OpenError::no_images(root));
    }
    let mut folders: Vec<&str> = known().copied().collect();
    folders.dedup();
    let folders = folders.join(", ");
    let (reason, remedy) = match forced {
        Some(format) => (
            format!(
                "the configuration says `format = \"{format}\"`, but it holds neither PNG images nor the folder {folders}"
            ),
            "is it another folder?",
        ),
        None => (
            format!(
                "it holds no PNG images (unpack archives before), and none of the folders {folders}"
            ),
            SET_FORMAT,
        ),
    };
    Err(OpenError::unknown_layout(root, &reason, remedy))
}

/// Returns the format if the name of the folder and the files beside it determine it.
fn by_layout(root: &Path, folder: &Path) -> Option<Format> {
    let name = folder.file_name()?.to_str()?;
    // A folder of this name may be of several formats.
    if name == "radar" {
        let folders = [Some(root), folder.parent()].into_iter().flatten();
        let files = ["radar.timestamps", "gt/radar_odometry.csv"];
        let mut places = folders.flat_map(|folder| files.map(|file| folder.join(file)));
        return places.any(|file| file.exists()).then_some(Format::Oxford);
    }
    known_by_name(name).map(|(format, ..)| *format)
}

fn by_image(
    root: &Path,
    folder: &Path,
    images: &mut Images,
) -> Result<(Format, String), OpenError> {
    let Some(image) = FirstImage::read(images)?.filter(FirstImage::has_stamps) else {
        let size = images.size;
        if size.height > size.width && images.name_stamp_ns(0).is_some() {
            let evidence = "transposed images, named by times.";
            return Ok((Format::Mulran, evidence.to_owned()));
        }
        let reason = format!(
            "its images ({size}) have no stamps in their first 8 columns, have no list of stamps beside them, and are not named by times"
        );
        return Err(OpenError::unknown_layout(folder, &reason, SET_FORMAT));
    };
    let boreas_folders = has_boreas_folders(root);
    let formats = Format::OF_IMAGES.iter().copied();
    let scores = formats.map(|format| (-score(format, &image, boreas_folders), format));
    let mut scores: Vec<_> = scores.collect();
    scores.sort_unstable();
    let (best, format) = scores[0];
    let equal = scores[1..].iter().filter(|(score, _)| *score == best);
    let equal: Vec<&str> = equal.map(|(_, format)| format.name()).collect();
    let mut evidence = evidence(&image);
    if let Some(first) = equal.first() {
        let equal = equal.join(" and ");
        evidence += &format!(" It fits {equal} equally: set `format = \"{first}\"` for that.");
    }
    Ok((format, evidence))
}

fn evidence(image: &FirstImage) -> String {
    let named = image.named_by().map_or_else(
        || "names that are not times of the sweep".to_owned(),
        |by| format!("named by {}", by.description()),
    );
    let of = |is_so: bool, words| if is_so { words } else { "" };
    let chirps = of(image.chirps_alternate(), ", chirps alternate");
    let unit = of(image.nanoseconds(), ", stamps in ns");
    format!("{} range bins, {named}{chirps}{unit}.", image.bins)
}

const NEVER: i32 = -100;

fn score(format: Format, image: &FirstImage, boreas_folders: bool) -> i32 {
    let Some(profile) = Profile::of(format).filter(|it| it.bins.is_some()) else {
        return NEVER;
    };
    let by_name = match image.named_by() {
        None => 0,
        Some(by) if by == profile.named_by => 2,
        Some(_) => -2,
    };
    let is_in_ns = format == Format::MulranOxfordForm;
    by_name
        + 2 * i32::from(profile.bins == Some(image.bins))
        + 2 * i32::from(image.chirps_alternate() == profile.chirps)
        - 1
        - 3 * i32::from(image.nanoseconds() != is_in_ns)
        + 4 * i32::from(boreas_folders && is_boreas(format))
}
