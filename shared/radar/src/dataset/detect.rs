//! Which format a folder holds: by its layout, else by what the first image says.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::OpenError;
use super::first_look::{FirstLook, NamedBy};
use super::format::Format;
use super::image_source::ImageSource;
use super::images::{Images, has_png};

/// A dataset that was found, before its format's reader takes over.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) format: Format,
    /// The folder of images.
    pub(crate) folder: PathBuf,
    pub(crate) images: Images,
    /// How the format was decided, where that is worth saying.
    pub(crate) notes: Vec<String>,
    /// The list of stamps, where it lies in no file.
    pub(crate) stamps: Option<String>,
}

impl Found {
    /// A recording that lies in no folder.
    pub(crate) fn source(
        source: Box<dyn ImageSource>,
        forced: Option<Format>,
    ) -> Result<Self, OpenError> {
        let format = forced.unwrap_or(source.format());
        let (folder, stamps) = (source.folder(), source.stamps());
        Ok(Self {
            format,
            folder,
            images: Images::of(source)?,
            notes: Vec::new(),
            stamps,
        })
    }
}

/// Where each format keeps its images, below the root.
const LAYOUTS: [(Format, &[&str]); 8] = [
    (Format::Radiate, &["Navtech_Polar"]),
    (Format::Oord, &["Navtech_CTS350-X_Radar"]),
    (
        Format::MulranOxfordForm,
        &[
            "polar_oxford_form",
            "radar/polar_oxford_form",
            "sensor_data/radar/polar_oxford_form",
        ],
    ),
    (
        Format::Mulran,
        &["sensor_data/radar/polar", "radar/polar", "polar"],
    ),
    (Format::Fomo, &["navtech"]),
    (Format::Oxford, &["radar"]),
    (Format::Boreas, &["radar"]),
    (Format::BoreasRt, &["radar"]),
];

/// Finds the images at `root`, as `forced` or as detected.
pub(crate) fn locate(root: &Path, forced: Option<Format>) -> Result<Found, OpenError> {
    check_folder(root)?;
    let folder = find_folder(root, forced)?;
    let mut images = Images::open(&folder)?;
    let (format, notes) = match forced.or_else(|| by_layout(root, &folder)) {
        Some(format) => (format, Vec::new()),
        None => by_image(root, &folder, &mut images)?,
    };
    Ok(Found {
        format,
        folder,
        images,
        notes,
        stamps: None,
    })
}

fn check_folder(root: &Path) -> Result<(), OpenError> {
    match fs::metadata(root) {
        Ok(entry) if entry.is_dir() => Ok(()),
        Ok(_) => Err(OpenError::NotAFolder {
            path: root.to_owned(),
        }),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Err(OpenError::Missing {
            path: root.to_owned(),
        }),
        Err(source) => Err(OpenError::Io {
            path: root.to_owned(),
            source,
        }),
    }
}

/// The folder that holds the images: one of the layouts', else the root.
fn find_folder(root: &Path, forced: Option<Format>) -> Result<PathBuf, OpenError> {
    let known = || {
        LAYOUTS
            .iter()
            .filter(|(f, _)| forced.is_none_or(|forced| forced == *f))
            .flat_map(|(_, folders)| folders.iter())
    };
    let mut candidates = known().map(|folder| root.join(folder));
    if let Some(folder) = candidates.clone().find(|folder| has_png(folder)) {
        return Ok(folder);
    }
    if has_png(root) {
        // `.` and `..` would hide the folder's name, beside which some formats keep their stamps.
        return Ok(fs::canonicalize(root).unwrap_or_else(|_| root.to_owned()));
    }
    // A known folder that is there but empty tells more than the root.
    if let Some(folder) = candidates.find(|folder| folder.is_dir()) {
        return Err(OpenError::NoImages { path: folder });
    }
    if fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_none()) {
        return Err(OpenError::NoImages {
            path: root.to_owned(),
        });
    }
    let mut folders: Vec<&str> = known().copied().collect();
    folders.dedup();
    let reason = format!(
        "it holds no PNG images itself, and none of the folders {}",
        folders.join(", ")
    );
    Err(OpenError::UnknownLayout {
        path: root.to_owned(),
        reason,
    })
}

/// The format that a folder's name and its neighbours leave no doubt of.
fn by_layout(root: &Path, folder: &Path) -> Option<Format> {
    let name = folder.file_name()?.to_str()?;
    let beside = |file: &str| {
        root.join(file).exists()
            || folder
                .parent()
                .is_some_and(|parent| parent.join(file).exists())
    };
    match name {
        "Navtech_Polar" => Some(Format::Radiate),
        "Navtech_CTS350-X_Radar" => Some(Format::Oord),
        "polar_oxford_form" => Some(Format::MulranOxfordForm),
        "polar" => Some(Format::Mulran),
        "navtech" => Some(Format::Fomo),
        "radar" if beside("radar.timestamps") || beside("gt/radar_odometry.csv") => {
            Some(Format::Oxford)
        }
        _ => None,
    }
}

/// The format that fits the first image best.
fn by_image(
    root: &Path,
    folder: &Path,
    images: &mut Images,
) -> Result<(Format, Vec<String>), OpenError> {
    let unknown = |reason: &str| OpenError::UnknownLayout {
        path: folder.to_owned(),
        reason: format!("its images ({}) {reason}", images_size(folder)),
    };
    let Some(look) = FirstLook::take(images).filter(FirstLook::has_stamps) else {
        let without_metadata =
            images.size.height > images.size.width && images.name_stamp_ns(0).is_some();
        return match without_metadata {
            true => Ok((
                Format::Mulran,
                vec![decided(
                    Format::Mulran,
                    "images on their side, named by times",
                )],
            )),
            false => Err(unknown(
                "bear no stamps in their first 8 columns, lie beside no list of stamps, and are not named by times",
            )),
        };
    };
    let boreas_folders = ["applanix", "calib"].iter().any(|f| root.join(f).is_dir());
    let mut scores: Vec<(i32, Format)> = Format::ALL
        .iter()
        .map(|f| (score(*f, &look, boreas_folders), *f))
        .collect();
    scores.sort_by_key(|(score, format)| (-score, *format));
    let (best, format) = scores[0];
    let equal: Vec<&str> = scores
        .iter()
        .skip(1)
        .filter(|(s, _)| *s == best)
        .map(|(_, f)| f.name())
        .collect();
    let mut note = decided(format, &evidence(&look));
    if !equal.is_empty() {
        note += &format!(
            " It fits {} equally: `format = \"{}\"` would force that.",
            equal.join(" and "),
            equal[0]
        );
    }
    Ok((format, vec![note]))
}

fn images_size(folder: &Path) -> String {
    Images::open(folder)
        .map(|images| images.size.to_string())
        .unwrap_or_default()
}

fn decided(format: Format, evidence: &str) -> String {
    format!(
        "The folder's layout names no dataset; read as {format} from its first image: {evidence}."
    )
}

fn evidence(look: &FirstLook) -> String {
    let named = look
        .named_by()
        .map_or("a name that is no time of the sweep", NamedBy::words);
    let named = if look.named_by().is_some() {
        format!("named by {named}")
    } else {
        named.to_owned()
    };
    let chirps = if look.chirps_alternate() {
        ", chirps alternate"
    } else {
        ""
    };
    let unit = if look.nanoseconds() {
        ", stamps in ns"
    } else {
        ""
    };
    format!("{} range bins, {named}{chirps}{unit}", look.bins())
}

/// Of formats that no image can be told by.
const NEVER: i32 = -100;

/// How well a format fits; formats without metadata columns, and OORD, which differs from Oxford in its folders only, not at all.
fn score(format: Format, look: &FirstLook, boreas_folders: bool) -> i32 {
    let (bins, named, chirps): (&[usize], NamedBy, bool) = match format {
        Format::Oxford => (&[3768], NamedBy::Start, false),
        Format::Boreas => (&[3360], NamedBy::Middle, false),
        Format::BoreasRt => (&[6848], NamedBy::Middle, true),
        Format::Fomo => (&[6848], NamedBy::Start, false),
        Format::MulranOxfordForm => (&[3360], NamedBy::End, false),
        Format::Oord | Format::Mulran | Format::Radiate => return NEVER,
    };
    let boreas = matches!(format, Format::Boreas | Format::BoreasRt);
    let by_name = look
        .named_by()
        .map_or(0, |by| if by == named { 2 } else { -2 });
    let by_bins = if bins.contains(&look.bins()) { 2 } else { 0 };
    let by_chirps = if look.chirps_alternate() == chirps {
        1
    } else {
        -1
    };
    let by_unit = if look.nanoseconds() == (format == Format::MulranOxfordForm) {
        0
    } else {
        -3
    };
    let by_folders = if boreas_folders && boreas { 4 } else { 0 };
    by_name + by_bins + by_chirps + by_unit + by_folders
}
