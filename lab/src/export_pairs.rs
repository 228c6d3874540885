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
//! | `twist` | f4 (3,) | m/s ahead and to the left, rad/s: the velocity of the motion compensation; zero without |
//! | `sequence` | u4 | number of the sequence |
//!
//! A sequence is an unbroken row of one recording's scans. Where a scan is left out, because it cannot be read or the truth does not
//! say where it was, the next one begins a sequence as the first one did: nothing is searched, and its sweep is not compensated,
//! nor those of the next `masking.lag`. At run time an unreadable scan breaks no chain; here it does, so that any two neighbours of
//! one number are consecutive scans.
//!
//! - [`recording`]: what is read, and its truth; [`scans`]: reading ahead;
//! - [`preparation`]: from scans to records;
//! - [`record`], [`npy`]: how they are written;
//! - [`provenance`]: `pairs.toml`, which says what they were made of.

mod npy;
mod preparation;
mod provenance;
mod record;
mod recording;
mod scans;

use std::{fmt, fs, io::IsTerminal, path::Path, process::ExitCode, time::Instant};

use gyre::{Failure, configuration::Configuration, print};
use gyre_radar::OwnedScan;
use indicatif::{ProgressBar, ProgressStyle};

use crate::{cli::ExportPairsArguments, report::save};
use npy::NpyWriter;
use preparation::Preparation;
use provenance::Sequence;
use record::Record;
use recording::Recording;

/// Writes the records of all recordings, and what they were made of.
///
/// # Errors
/// A recording that cannot be used, a file that cannot be written.
pub fn export_pairs(arguments: &ExportPairsArguments) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    provenance::check_place(out)?;
    let configurations = recording::configurations(arguments)?;
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
    for mut recording in recordings {
        export.recording(&mut recording, &bar)?;
    }
    bar.finish_and_clear();
    let counts = export.finish(&configurations[0])?;
    let wall_s = started.elapsed().as_secs_f64();
    print::line(format_args!(
        "wrote {counts} to {} ({:.1} MB) in {wall_s:.1} s",
        out.display(),
        fs::metadata(out)?.len() as f64 * 1e-6,
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn progress_bar(scans: usize) -> ProgressBar {
    let bar = match std::io::stderr().is_terminal() {
        true => ProgressBar::new(scans as u64),
        false => ProgressBar::hidden(),
    };
    let template = "exporting {wide_bar} {pos}/{len} scans, {per_sec}, {eta} left";
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// A file that is being written.
struct Export<'a> {
    out: &'a Path,
    file: NpyWriter,
    preparation: Preparation,
    sequences: Vec<Sequence>,
    unreadable: usize,
    without_truth: usize,
    /// A record's bytes.
    encoded: Vec<u8>,
}

impl<'a> Export<'a> {
    fn begin(configuration: &Configuration, out: &'a Path) -> Result<Self, Failure> {
        let n = configuration.odometry.raster.n;
        let preparation = Preparation::new(configuration)?;
        let file = NpyWriter::create(out, &Record::dtype(n));
        Ok(Self {
            out,
            file: file.map_err(|error| cannot_write(out, &error))?,
            preparation,
            sequences: Vec::new(),
            unreadable: 0,
            without_truth: 0,
            encoded: Vec::new(),
        })
    }

    /// Appends a recording's scans. One that gives none is refused: it, or its truth, is not what was meant.
    fn recording(&mut self, recording: &mut Recording, bar: &ProgressBar) -> Result<(), Failure> {
        let (sequences, without_truth) = (self.sequences.len(), self.without_truth);
        self.preparation.begin();
        let (source, played) = (&recording.source, recording.played.clone());
        scans::for_each_scan(recording.dataset.as_mut(), played.clone(), |index, read| {
            bar.inc(1);
            match read {
                Ok(scan) => self.scan(source, index, scan),
                Err(error) => {
                    self.leave_out(&error);
                    Ok(())
                }
            }
        })?;
        if self.sequences.len() > sequences {
            return Ok(());
        }
        let data = &source.data;
        Err(match self.without_truth - without_truth {
            0 => format!("{data}: none of its {} scans can be read", played.len()),
            read => {
                let truth = source.truth.path.display();
                format!(
                    "{data}: {truth} has no pose at the time of any of its {read} readable scans"
                )
            }
        }
        .into())
    }

    fn scan(
        &mut self,
        source: &recording::Source,
        index: usize,
        scan: &OwnedScan,
    ) -> Result<(), Failure> {
        let Some(pose) = source.truth.pose(scan.geometry.stamp_ns) else {
            self.without_truth += 1;
            self.preparation.begin();
            return Ok(());
        };
        let begins = self.preparation.begins();
        let number = (self.sequences.len() - usize::from(!begins)) as u32;
        match self.preparation.next(&scan.view(), pose, number) {
            Ok(record) => record.encode(&mut self.encoded),
            Err(error) => {
                self.leave_out(&format_args!("scan {index} of {}: {error}", source.data));
                return Ok(());
            }
        }
        self.file
            .append(&self.encoded)
            .map_err(|error| cannot_write(self.out, &error))?;
        if begins {
            self.sequences.push(Sequence::new(number, source, index));
        }
        if let Some(sequence) = self.sequences.last_mut() {
            sequence.scans += 1;
        }
        Ok(())
    }

    fn leave_out(&mut self, reason: &dyn fmt::Display) {
        print::note(format_args!("left out: {reason}"));
        self.unreadable += 1;
        self.preparation.begin();
    }

    /// Writes what the file was made of, and gives it its name. Returns what was written, in words.
    fn finish(self, configuration: &Configuration) -> Result<String, Failure> {
        let text = provenance::to_toml(configuration, &self.sequences)?;
        save(&provenance::place(self.out), &text)?;
        self.file
            .finish()
            .map_err(|error| cannot_write(self.out, &error))?;
        let scans: usize = self.sequences.iter().map(|sequence| sequence.scans).sum();
        let sequences = self.sequences.len();
        let plural = if sequences == 1 { "" } else { "s" };
        let left_out = match (self.unreadable, self.without_truth) {
            (0, 0) => String::new(),
            (unreadable, untrue) => {
                format!(" (left out: {unreadable} unreadable, {untrue} without truth)")
            }
        };
        Ok(format!(
            "{scans} scans in {sequences} sequence{plural}{left_out}"
        ))
    }
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    format!("cannot write {}: {error}", path.display()).into()
}
