//! Faults on purpose: a copy of a recording, real or simulated, in which some scans are spoilt in a known way. An odometry should
//! get over each of them, and say that it had to.
//!
//! The copy has links to all that is untouched, so it takes little room and goes with the recording. What it is spoilt with
//! depends on the plan alone: the same plan gives the same pixels.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::num::NonZeroUsize;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::str::FromStr;
use std::{fmt, fs};

use gyre_radar::{Dataset, DatasetOptions, OwnedScan};
use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

use gyre::{Failure, picture::Picture};

/// What is done to a scan. Stamps, encoder and all else that a file says beside the powers stay as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Every power is drawn evenly from 0 to 255.
    Noise,
    /// The powers are those of the scan ten later. The last ten scans have none, and are spared.
    Later,
    /// The azimuths are rolled by a quarter turn.
    Turned,
    /// The half turn from straight ahead on is blank.
    HalfBlank,
    /// The scan is missing.
    Dropped,
}

/// How much later the scan is that stands in for another.
const LATER: usize = 10;

impl Fault {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Noise,
        Self::Later,
        Self::Turned,
        Self::HalfBlank,
        Self::Dropped,
    ];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Noise => "noise",
            Self::Later => "later",
            Self::Turned => "turned",
            Self::HalfBlank => "half-blank",
            Self::Dropped => "dropped",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Fault {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|fault| fault.name() == name)
            .ok_or_else(|| format!("it is one of {}", known()))
    }
}

/// Which scans are hit by what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultPlan {
    /// What is done to them.
    pub fault: Fault,
    /// Every so-manyth scan is hit, never the first one.
    pub every: NonZeroUsize,
    /// Where noise begins.
    pub seed: u64,
}

impl FaultPlan {
    /// The numbers, from 0, of the scans that are hit in a recording of so many.
    pub fn hits(&self, scans: usize) -> impl Iterator<Item = usize> {
        let end = match self.fault {
            Fault::Later => scans.saturating_sub(LATER),
            _ => scans,
        };
        (self.every.get()..end).step_by(self.every.get())
    }

    /// Spoils the powers, row by row, of scan `index`.
    fn spoil(&self, index: usize, azimuths: usize, powers: &mut [u8]) {
        let bins = powers.len() / azimuths;
        match self.fault {
            Fault::Noise => {
                let mut random = ChaCha8Rng::seed_from_u64(self.seed);
                random.set_stream(index as u64);
                random.fill_bytes(powers);
            }
            Fault::Turned => powers.rotate_left(azimuths / 4 * bins),
            Fault::HalfBlank => powers[..azimuths / 2 * bins].fill(0),
            Fault::Later | Fault::Dropped => {}
        }
    }
}

/// Writes a spoilt copy of the recording in the folder `source`, of any format, to the folder `out`. Returns the numbers of the
/// scans that were hit, by their place in `source`.
///
/// # Errors
/// [`Failure`] where `source` cannot be read, `out` is not empty, or the copy cannot be written.
pub fn write_faulty(source: &Path, out: &Path, plan: &FaultPlan) -> Result<Vec<usize>, Failure> {
    let source = source.canonicalize().unwrap_or_else(|_| source.to_owned());
    let mut dataset = gyre_radar::open(&source, &DatasetOptions::default())?;
    let hits: Vec<usize> = plan.hits(dataset.len()).collect();
    let spoilt: BTreeSet<OsString> = hits
        .iter()
        .filter_map(|&i| Some(dataset.file(i).file_name()?.to_owned()))
        .collect();
    let folder = dataset.file(0).parent().unwrap_or(&source);
    let images = folder
        .strip_prefix(&source)
        .unwrap_or(Path::new(""))
        .to_owned();
    require_empty(out)?;
    link_around(&source, out, &images, &spoilt)?;
    if plan.fault != Fault::Dropped {
        for &index in &hits {
            write_spoilt(dataset.as_mut(), index, plan, &out.join(&images))?;
        }
    }
    Ok(hits)
}

fn require_empty(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(cannot("write", folder))?;
    match entries(folder)?.into_iter().min() {
        Some(other) => Err(format!(
            "{} holds `{}`: give an empty folder",
            folder.display(),
            other.display()
        )
        .into()),
        None => Ok(()),
    }
}

fn entries(folder: &Path) -> Result<Vec<OsString>, Failure> {
    let name = |entry: std::io::Result<fs::DirEntry>| entry.map(|entry| entry.file_name());
    fs::read_dir(folder)
        .and_then(|entries| entries.map(name).collect())
        .map_err(cannot("list", folder))
}

/// Links all of `source` into `out`, folders as a whole, but for the folders that lead to `images`, and in there but for `spoilt`.
fn link_around(
    source: &Path,
    out: &Path,
    images: &Path,
    spoilt: &BTreeSet<OsString>,
) -> Result<(), Failure> {
    let (mut here, mut there) = (source.to_owned(), out.to_owned());
    for next in images {
        link_all(&here, &there, |name| name != next)?;
        here.push(next);
        there.push(next);
        fs::create_dir(&there).map_err(cannot("write", &there))?;
    }
    link_all(&here, &there, |name| !spoilt.contains(name))
}

fn link_all(here: &Path, there: &Path, wanted: impl Fn(&OsStr) -> bool) -> Result<(), Failure> {
    for name in entries(here)?.iter().filter(|name| wanted(name)) {
        let link = there.join(name);
        symlink(here.join(name), &link).map_err(cannot("write", &link))?;
    }
    Ok(())
}

fn write_spoilt(
    dataset: &mut dyn Dataset,
    index: usize,
    plan: &FaultPlan,
    folder: &Path,
) -> Result<(), Failure> {
    let mut scan = read(dataset, index)?;
    let mut powers = match plan.fault {
        Fault::Later => powers_of(&read(dataset, index + LATER)?),
        _ => powers_of(&scan),
    };
    let geometry = scan.geometry;
    plan.spoil(index, geometry.azimuths, &mut powers);
    for (row, powers) in powers.chunks_exact(geometry.bins).enumerate() {
        let first = geometry.first_byte + row * geometry.stride;
        scan.bytes[first..first + geometry.bins].copy_from_slice(powers);
    }
    if dataset.is_transposed() {
        scan.bytes = transposed(&powers, geometry.bins);
    }
    let path = folder.join(dataset.file(index).file_name().unwrap_or_default());
    let size = dataset.image_size();
    let picture = Picture {
        width: size.width,
        height: size.height,
        pixels: scan.bytes,
    };
    Ok(picture.write(&path)?)
}

fn read(dataset: &mut dyn Dataset, index: usize) -> Result<OwnedScan, Failure> {
    let mut scan = OwnedScan::with_limits(dataset.limits());
    scan.geometry = dataset.read(index, scan.slot())?;
    Ok(scan)
}

/// All rows' powers, without what stands between them.
fn powers_of(scan: &OwnedScan) -> Vec<u8> {
    let view = scan.view();
    (0..view.geometry.azimuths)
        .flat_map(|azimuth| view.row(azimuth))
        .copied()
        .collect()
}

fn transposed(rows: &[u8], columns: usize) -> Vec<u8> {
    (0..columns)
        .flat_map(|column| rows.iter().skip(column).step_by(columns))
        .copied()
        .collect()
}

fn cannot(verb: &'static str, path: &Path) -> impl Fn(std::io::Error) -> Failure {
    let path = path.display().to_string();
    move |error| format!("cannot {verb} {path}: {error}").into()
}
