//! `gyre-lab corrupt`: a copy of a recording, real or simulated, in which some scans are corrupted
//! in a known way. An odometry should get over each of them, and report that it had to.
//!
//! The copy has links to all that is untouched, so it takes little room and goes with the
//! recording. Noise depends on the seed alone: the same arguments give the same pixels.

#[cfg(test)]
mod tests;

use std::{
    collections::BTreeSet,
    ffi::{OsStr, OsString},
    fs, io,
    num::NonZeroUsize,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, ValueEnum, builder::PossibleValue};
use gyre_datasets::{Dataset, DatasetOptions};
use gyre_geometry::OwnedScan;
use gyre_configuration::terminal::{Failure, print};
use gyre_tools::export::write_grey;
use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::report::{cannot_write, make_folder};

/// The arguments of `gyre-lab corrupt`.
#[derive(Debug, Args)]
pub struct CorruptArguments {
    /// The dataset's folder. The copy has links to it, and needs it.
    pub path: PathBuf,
    /// The fault.
    #[arg(long)]
    pub fault: Fault,
    /// Every Nth scan is corrupted, never the first.
    #[arg(long, value_name = "N", default_value = "20")]
    pub every: NonZeroUsize,
    /// Seed of the noise.
    #[arg(long, default_value = "1")]
    pub seed: u64,
    /// The folder of the copy, empty or new.
    #[arg(long)]
    pub out: PathBuf,
}

/// A fault of a scan. Stamps, encoder and all other data beside the powers stay unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Fault {
    /// Every power is drawn uniformly from 0 to 255.
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

/// Offset of the scan that replaces another.
const LATER: usize = 10;

/// Writes the corrupted copy, and says which scans were hit.
///
/// # Errors
/// A recording that cannot be read, an output folder that is not empty or cannot be written.
pub fn corrupt(arguments: &CorruptArguments) -> Result<ExitCode, Failure> {
    let hits = arguments.write()?;
    let numbers: Vec<_> = hits.iter().map(usize::to_string).collect();
    let fault = arguments.fault.to_possible_value();
    print::line(format_args!(
        "wrote {} with {} in {} scans: {}",
        arguments.out.display(),
        fault.as_ref().map_or("", PossibleValue::get_name),
        hits.len(),
        numbers.join(" ")
    ))?;
    Ok(ExitCode::SUCCESS)
}

impl CorruptArguments {
    /// Writes the corrupted copy. Returns the numbers of the scans that were hit, by their place in
    /// the recording.
    fn write(&self) -> Result<Vec<usize>, Failure> {
        let (resolved, out) = (self.path.canonicalize(), &self.out);
        let source = resolved.unwrap_or_else(|_| self.path.clone());
        let mut dataset = gyre_datasets::open(&source, &DatasetOptions::default())?;
        let hits: Vec<usize> = self.hits(dataset.len()).collect();
        let name = |index: &usize| Some(dataset.file(*index).file_name()?.to_owned());
        let corrupted: BTreeSet<OsString> = hits.iter().filter_map(name).collect();
        make_folder(out)?;
        if let Some(other) = entries(out)?.into_iter().min() {
            let (out, other) = (out.display(), other.display());
            return Err(format!("{out} holds `{other}`: give an empty folder").into());
        }
        // All is linked, folders as a whole, but for the folders that lead to the images, and in
        // there but for the corrupted ones.
        let folder = dataset.file(0).parent().unwrap_or(&source);
        let (mut here, mut there) = (source.clone(), out.clone());
        for next in folder.strip_prefix(&source).unwrap_or(Path::new("")) {
            link_all(&here, &there, |name| name != next)?;
            here.push(next);
            there.push(next);
            make_folder(&there)?;
        }
        link_all(&here, &there, |name| !corrupted.contains(name))?;
        if self.fault != Fault::Dropped {
            for &index in &hits {
                self.write_scan(dataset.as_mut(), index, &there)?;
            }
        }
        Ok(hits)
    }

    /// The numbers, from 0, of the scans that are hit in a recording of so many.
    fn hits(&self, scans: usize) -> impl Iterator<Item = usize> {
        let end = match self.fault {
            Fault::Later => scans.saturating_sub(LATER),
            _ => scans,
        };
        (self.every.get()..end).step_by(self.every.get())
    }

    fn write_scan(
        &self,
        dataset: &mut dyn Dataset,
        index: usize,
        folder: &Path,
    ) -> Result<(), Failure> {
        let mut scan = read(dataset, index)?;
        let geometry = scan.geometry;
        let mut powers = match self.fault {
            Fault::Later => powers_of(&read(dataset, index + LATER)?),
            _ => powers_of(&scan),
        };
        match self.fault {
            Fault::Noise => {
                let mut random = ChaCha8Rng::seed_from_u64(self.seed);
                random.set_stream(index as u64);
                random.fill_bytes(&mut powers);
            }
            Fault::Turned => powers.rotate_left(geometry.azimuths / 4 * geometry.bins),
            Fault::HalfBlank => powers[..geometry.azimuths / 2 * geometry.bins].fill(0),
            Fault::Later | Fault::Dropped => {}
        }
        for (row, powers) in powers.chunks_exact(geometry.bins).enumerate() {
            let first = geometry.first_byte + row * geometry.stride;
            scan.bytes[first..first + geometry.bins].copy_from_slice(powers);
        }
        if dataset.is_transposed() {
            let column = |bin| powers.iter().skip(bin).step_by(geometry.bins).copied();
            scan.bytes = (0..geometry.bins).flat_map(column).collect();
        }
        let file = folder.join(dataset.file(index).file_name().unwrap_or_default());
        write_grey(&file, dataset.image_size().width, &scan.bytes)
    }
}

/// Links the entries of `here` whose names are wanted into `there`.
fn link_all(here: &Path, there: &Path, wanted: impl Fn(&OsStr) -> bool) -> Result<(), Failure> {
    for name in entries(here)?.iter().filter(|name| wanted(name)) {
        let link = there.join(name);
        symlink(here.join(name), &link).map_err(cannot_write(&link))?;
    }
    Ok(())
}

fn entries(folder: &Path) -> Result<Vec<OsString>, Failure> {
    let failed = |error| format!("cannot list {}: {error}", folder.display());
    let names = fs::read_dir(folder).map_err(failed)?;
    let names: io::Result<_> = names.map(|entry| Ok(entry?.file_name())).collect();
    Ok(names.map_err(failed)?)
}

fn read(dataset: &mut dyn Dataset, index: usize) -> Result<OwnedScan, Failure> {
    let mut scan = OwnedScan::with_limits(dataset.limits());
    scan.geometry = dataset.read(index, scan.slot())?;
    Ok(scan)
}

/// Returns the powers of all rows, without the metadata between them.
fn powers_of(scan: &OwnedScan) -> Vec<u8> {
    scan.view().power().iter().copied().collect()
}
