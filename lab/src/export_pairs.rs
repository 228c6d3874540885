//! `gyre-lab export-pairs`: rasters with their true poses in one file, to train masks on.
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
//! - [`recordings`]: what is read, and its truth; [`scans`]: reading ahead;
//! - [`preparation`]: from scans to records;
//! - [`record`], [`npy`]: how they are written;
//! - [`provenance`]: `pairs.toml`, which says what they were made of.

mod npy;
mod preparation;
mod provenance;
mod record;
mod recordings;
mod scans;

use std::{
    fmt, fs,
    io::IsTerminal,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Instant,
};

use gyre_radar::OwnedScan;
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::ExportPairsArguments;
use gyre::{Failure, configuration::Configuration, print};
use npy::NpyWriter;
use preparation::Preparation;
use provenance::{Provenance, Sequence};
use record::Record;
use recordings::{Origin, Recording};

/// Writes the records of all recordings, and what they were made of.
pub fn export_pairs(arguments: &ExportPairsArguments) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    provenance::check_place(out)?;
    let configurations = recordings::configurations(arguments)?;
    let recordings = configurations
        .iter()
        .map(Recording::open)
        .collect::<Result<Vec<_>, _>>()?;
    let started = Instant::now();
    let mut export = Export::begin(&configurations[0], out)?;
    let bar = progress_bar(
        recordings
            .iter()
            .map(|recording| recording.played.len())
            .sum(),
    );
    for recording in recordings {
        export.recording(recording, &bar)?;
    }
    bar.finish_and_clear();
    let counts = export.finish(&configurations[0])?;
    let wall_s = started.elapsed().as_secs_f64();
    print::line(format_args!(
        "wrote {counts} to {} ({:.1} MB) in {wall_s:.1} s, {:.0} scans/s",
        out.display(),
        fs::metadata(out)?.len() as f64 * 1e-6,
        counts.scans as f64 / wall_s
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn progress_bar(scans: usize) -> ProgressBar {
    let bar = if std::io::stderr().is_terminal() {
        ProgressBar::new(scans as u64)
    } else {
        ProgressBar::hidden()
    };
    if let Ok(style) = ProgressStyle::with_template(
        "exporting {wide_bar} {pos}/{len} scans, {per_sec}, {eta} left",
    ) {
        bar.set_style(style);
    }
    bar
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
        let file = NpyWriter::create(out, &Record::dtype(n), Record::bytes(n))
            .map_err(cannot_write(out))?;
        let encoded = Vec::with_capacity(Record::bytes(n));
        Ok(Self {
            out: out.to_owned(),
            file,
            preparation,
            sequences: Vec::new(),
            counts: Counts::default(),
            encoded,
        })
    }

    /// Appends a recording's scans. One that gives none is refused: it, or its truth, is not what was meant.
    fn recording(&mut self, recording: Recording, bar: &ProgressBar) -> Result<(), Failure> {
        let Recording {
            mut dataset,
            played,
            origin,
        } = recording;
        let (before, scans) = (self.counts, played.len());
        self.preparation.begin();
        scans::for_each_scan(dataset.as_mut(), played, |index, read| {
            bar.inc(1);
            match read {
                Ok(scan) => self.scan(&origin, index, scan)?,
                Err(error) => self.leave_out(&error),
            }
            Ok(())
        })?;
        let (data, truth) = (&origin.data, origin.truth.path.display());
        match (
            self.counts.scans - before.scans,
            self.counts.without_truth - before.without_truth,
        ) {
            (0, 0) => Err(format!("{data}: none of its {scans} scans can be read").into()),
            (0, read) => Err(format!(
                "{data}: {truth} has no pose at the time of any of its {read} readable scans"
            )
            .into()),
            _ => Ok(()),
        }
    }

    fn scan(&mut self, origin: &Origin, index: usize, scan: &OwnedScan) -> Result<(), Failure> {
        let Some(pose) = origin.truth.pose(scan.geometry.stamp_ns) else {
            self.counts.without_truth += 1;
            self.preparation.begin();
            return Ok(());
        };
        let begins = self.preparation.begins();
        let number = (self.sequences.len() - usize::from(!begins)) as u32;
        match self.preparation.next(&scan.view(), pose, number) {
            Ok(record) => record.encode(&mut self.encoded),
            Err(error) => {
                self.leave_out(&format_args!("scan {index} of {}: {error}", origin.data));
                return Ok(());
            }
        }
        self.file
            .append(&self.encoded)
            .map_err(cannot_write(&self.out))?;
        if begins {
            self.sequences.push(Sequence::new(number, origin, index));
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

    /// Writes what the file was made of, and gives it its name.
    fn finish(self, configuration: &Configuration) -> Result<Counts, Failure> {
        let beside = provenance::place(&self.out);
        let text = Provenance::new(configuration, &self.sequences).to_toml()?;
        fs::write(&beside, text).map_err(cannot_write(&beside))?;
        self.file.finish().map_err(cannot_write(&self.out))?;
        Ok(Counts {
            sequences: self.sequences.len(),
            ..self.counts
        })
    }
}

fn cannot_write(path: &Path) -> impl Fn(std::io::Error) -> Failure {
    move |error| format!("cannot write {}: {error}", path.display()).into()
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            scans,
            sequences,
            unreadable,
            without_truth,
        } = self;
        write!(
            f,
            "{scans} scans in {sequences} sequence{}",
            if *sequences == 1 { "" } else { "s" }
        )?;
        if unreadable + without_truth > 0 {
            write!(
                f,
                " (left out: {unreadable} unreadable, {without_truth} without truth)"
            )?;
        }
        Ok(())
    }
}
