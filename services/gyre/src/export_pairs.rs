//! `gyre export-pairs`: rasters with their true poses in one file, to train masks on.
//!
//! `pairs.npy` is a one-dimensional NumPy array with a record a scan, packed and little-endian:
//!
//! | field | type | what |
//! |---|---|---|
//! | `raster` | f2 (n, n) | what masking publishes: power above the floor, row 0 far ahead, column 0 far left |
//! | `searched` | f8 (3,) | x and y (m), yaw (rad): this scan's frame in that of the record before, as the decoupled search finds it in the two rasters of the file; NaN where a sequence begins |
//! | `pose` | f8 (3,) | x and y (m), yaw (rad) at the scan's time: the true pose, in the truth's own frame |
//! | `time_s` | f8 | the scan's time, mid-sweep, seconds since 1970 |
//! | `twist` | f4 (3,) | m/s ahead and to the left, rad/s: what the sweep was compensated with; zero where it was not |
//! | `sequence` | u4 | number of the sequence |
//!
//! A sequence is an unbroken row of one recording's scans. Where a scan is left out, because it cannot be read or the truth does not
//! say where it was, the next one begins a sequence as the first one did: nothing is searched, and its sweep is not compensated,
//! nor those of the next `masking.lag`. At run time an unreadable scan breaks no chain; here it does, so that any two neighbours of
//! one number are consecutive scans.
//!
//! - [`recordings`]: what is read, and its truth;
//! - [`preparation`]: from scans to records;
//! - [`record`], [`npy`]: how they are written;
//! - [`provenance`]: `pairs.toml`, which says what they were made of.

mod npy;
mod preparation;
mod provenance;
mod record;
mod recordings;

use std::{
    fmt, fs,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Instant,
};

use gyre_radar::OwnedScan;

use crate::{Failure, cli::ExportPairsArguments, configuration::Configuration, print};
use npy::NpyWriter;
use preparation::Preparation;
use provenance::{Provenance, Sequence};
use record::Record;
use recordings::Recording;

/// Writes the records of all recordings, and what they were made of.
pub fn export_pairs(arguments: &ExportPairsArguments) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    if out.extension().is_none_or(|extension| extension != "npy") {
        return Err(format!("--out {} must name a file that ends in .npy", out.display()).into());
    }
    let configurations = recordings::configurations(arguments)?;
    let recordings = configurations.iter().map(Recording::open).collect::<Result<Vec<_>, _>>()?;
    let common = &configurations[0];
    let started = Instant::now();
    let mut export = Export::begin(common, out)?;
    for mut recording in recordings {
        export.recording(&mut recording)?;
    }
    let (written, bytes) = export.finish(common)?;
    let wall_s = started.elapsed().as_secs_f64();
    print::line(format_args!(
        "wrote {written} to {} ({:.1} MB) in {wall_s:.1} s, {:.0} scans/s",
        out.display(),
        bytes as f64 * 1e-6,
        written.scans as f64 / wall_s
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// What was written and what was not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    scans: usize,
    sequences: usize,
    unreadable: usize,
    without_truth: usize,
}

/// A file that is being written.
struct Export {
    out: PathBuf,
    file: NpyWriter,
    preparation: Preparation,
    sequences: Vec<Sequence>,
    counts: Counts,
    /// A record's bytes.
    encoded: Vec<u8>,
}

impl Export {
    fn begin(configuration: &Configuration, out: &Path) -> Result<Self, Failure> {
        let n = configuration.raster.n;
        let preparation = Preparation::new(configuration)?;
        let file = NpyWriter::create(out, &Record::dtype(n), Record::bytes(n)).map_err(cannot_write(out))?;
        let encoded = Vec::with_capacity(Record::bytes(n));
        Ok(Self { out: out.to_owned(), file, preparation, sequences: Vec::new(), counts: Counts::default(), encoded })
    }

    /// Appends a recording's scans. One that gives none is refused: it, or its truth, is not what was meant.
    fn recording(&mut self, recording: &mut Recording) -> Result<(), Failure> {
        self.preparation.begin();
        let before = self.counts;
        let mut scan = OwnedScan::with_limits(recording.dataset.limits());
        for index in recording.played.clone() {
            match recording.dataset.read(index, scan.slot()) {
                Ok(geometry) => {
                    scan.geometry = geometry;
                    self.scan(recording, index, &scan)?;
                }
                Err(error) => self.leave_out(&error),
            }
        }
        match self.counts.scans - before.scans {
            0 => Err(recording.gives_nothing(self.counts.without_truth - before.without_truth)),
            _ => Ok(()),
        }
    }

    fn scan(&mut self, recording: &Recording, index: usize, scan: &OwnedScan) -> Result<(), Failure> {
        let Some(pose) = recording.truth.pose(scan.geometry.stamp_ns) else {
            self.counts.without_truth += 1;
            self.preparation.begin();
            return Ok(());
        };
        let begins = self.preparation.begins();
        let number = (self.sequences.len() - usize::from(!begins)) as u32;
        match self.preparation.next(&scan.view(), pose, number) {
            Ok(record) => record.encode(&mut self.encoded),
            Err(error) => {
                self.leave_out(&format_args!("scan {index} of {}: {error}", recording.data));
                return Ok(());
            }
        }
        self.file.append(&self.encoded).map_err(cannot_write(&self.out))?;
        if begins {
            self.sequences.push(Sequence::new(number, recording, index));
        }
        if let Some(sequence) = self.sequences.last_mut() {
            sequence.scans += 1;
        }
        self.counts.scans += 1;
        Ok(())
    }

    fn leave_out(&mut self, reason: &dyn fmt::Display) {
        print::note(format_args!("left out: {reason}"));
        self.counts.unreadable += 1;
        self.preparation.begin();
    }

    /// Gives the files their names; returns what is in them, and the bytes of `pairs.npy`.
    fn finish(self, configuration: &Configuration) -> Result<(Counts, u64), Failure> {
        let beside = self.out.with_extension("toml");
        let provenance = toml::to_string_pretty(&Provenance::new(configuration, &self.sequences))?;
        fs::write(&beside, provenance).map_err(cannot_write(&beside))?;
        self.file.finish().map_err(cannot_write(&self.out))?;
        let bytes = fs::metadata(&self.out).map_err(cannot_write(&self.out))?.len();
        Ok((Counts { sequences: self.sequences.len(), ..self.counts }, bytes))
    }
}

fn cannot_write(path: &Path) -> impl Fn(std::io::Error) -> Failure {
    move |error| format!("cannot write {}: {error}", path.display()).into()
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scans, sequences, unreadable, without_truth } = self;
        write!(f, "{scans} scans in {sequences} sequence{}", if *sequences == 1 { "" } else { "s" })?;
        if unreadable + without_truth > 0 {
            write!(f, " (left out: {unreadable} unreadable, {without_truth} without truth)")?;
        }
        Ok(())
    }
}
