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
//! A sequence is an unbroken row of one recording's scans. Where a scan is left out, because it
//! cannot be read or the truth does not say where it was, the next one begins a sequence as the
//! first one did: nothing is searched, and its sweep is not compensated, nor those of the next
//! `masking.lag`. At run time an unreadable scan breaks no chain; here it does, so that any two
//! neighbours of one number are consecutive scans.
//!
//! - [`preparation`]: from scans to records;
//! - [`npy`]: how they are written;
//! - [`provenance`]: `pairs.toml`, which says what they were made of.

mod npy;
mod preparation;
mod provenance;

use std::{fs, path::PathBuf, process::ExitCode, time::Instant};

use gyre_configuration::{Configuration, terminal::{Failure, print}};
use gyre_geometry::{Pose, OwnedScan};
use npy::NpyWriter;
use preparation::Preparation;
use provenance::Sequence;

use crate::{cli::ExportPairsArguments, recording::{Recording, Track}, report::save};

/// Writes the records of all recordings, and what they were made of.
///
/// # Errors
/// A recording that cannot be used, a file that cannot be written.
pub fn export_pairs(arguments: &ExportPairsArguments) -> Result<ExitCode, Failure> {
    let (out, started) = (&arguments.out, Instant::now());
    provenance::check_place(out)?;
    let configurations = configurations(arguments)?;
    let recordings = configurations
        .iter()
        .map(open)
        .collect::<Result<Vec<_>, _>>()?;
    let preparation = Preparation::new(&configurations[0])?;
    let mut export = Export {
        file: NpyWriter::create(out, preparation.dtype())?,
        preparation,
        sequences: Vec::new(),
        unreadable: 0,
        without_truth: 0,
    };
    for (mut recording, truth) in recordings {
        export.recording(&mut recording, &truth)?;
    }
    let counts = export.counts();
    let text = provenance::to_toml(&configurations[0], export.sequences)?;
    save(&out.with_extension("toml"), &text)?;
    export.file.finish()?;
    print::line(format_args!(
        "wrote {counts} to {} ({:.1} MB) in {:.1} s",
        out.display(),
        fs::metadata(out)?.len() as f64 * 1e-6,
        started.elapsed().as_secs_f64(),
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Returns the configuration of each recording that was named on the command line, or of what the
/// configuration itself plays.
fn configurations(arguments: &ExportPairsArguments) -> Result<Vec<Configuration>, Failure> {
    let mut common = Configuration::read(&arguments.configuration, &arguments.set)?;
    let named = arguments.ground_truth.as_ref();
    common.run.ground_truth = named.cloned().or(common.run.ground_truth);
    match (&common.run.ground_truth, arguments.data.as_slice()) {
        (Some(truth), recordings @ [_, _, ..]) => Err(format!(
            "{} can be the truth of one recording, not of {}: without it, each has its own",
            truth.display(),
            recordings.len()
        )
        .into()),
        (_, []) => Ok(vec![common.streaming(None)]),
        (_, recordings) => {
            let of = |data: &PathBuf| common.clone().streaming(Some(data));
            Ok(recordings.iter().map(of).collect())
        }
    }
}

/// Opens what a configuration names, with a truth to train with.
fn open(configuration: &Configuration) -> Result<(Recording, Track), Failure> {
    let mut recording = Recording::open(configuration)?;
    let Some(truth) = recording.truth.take() else {
        let lacks =
            "has no ground truth, and masks are trained by true poses: name it with --ground-truth";
        return Err(format!("{} {lacks}", recording.data).into());
    };
    if let Some(lacks) = truth.lacks() {
        let needed = "and masks are trained by poses at the scans' times";
        return Err(format!("{} has no {lacks}, {needed}", truth.path.display()).into());
    }
    Ok((recording, truth))
}

/// A file that is being written.
struct Export {
    file: NpyWriter,
    preparation: Preparation,
    sequences: Vec<Sequence>,
    unreadable: usize,
    without_truth: usize,
}

impl Export {
    /// Appends a recording's scans. One that gives none is refused: it, or its truth, is not what
    /// was meant.
    fn recording(&mut self, recording: &mut Recording, truth: &Track) -> Result<(), Failure> {
        let (sequences, without_truth) = (self.sequences.len(), self.without_truth);
        let mut scan = OwnedScan::with_limits(recording.dataset.limits());
        self.preparation.begin();
        for index in recording.played.clone() {
            if !recording.read(index, &mut scan) {
                self.unreadable += 1;
                self.preparation.begin();
            } else if let Some(pose) = truth.pose(scan.geometry.stamp_ns) {
                self.scan(index, &scan, pose, recording, truth)?;
            } else {
                self.without_truth += 1;
                self.preparation.begin();
            }
        }
        let (data, truth) = (&recording.data, truth.path.display());
        let reason = match self.without_truth - without_truth {
            _ if self.sequences.len() > sequences => return Ok(()),
            0 => format!("none of its {} scans can be read", recording.played.len()),
            read => {
                format!("{truth} has no pose at the time of any of its {read} readable scans")
            }
        };
        Err(format!("{data}: {reason}").into())
    }

    /// Appends a scan; one that cannot be rasterised is left out.
    fn scan(
        &mut self,
        index: usize,
        scan: &OwnedScan,
        pose: Pose,
        recording: &Recording,
        truth: &Track,
    ) -> Result<(), Failure> {
        let begins = self.preparation.begins();
        let number = self.sequences.len() - usize::from(!begins);
        match self.preparation.next(&scan.view(), pose, number as u32) {
            Ok(record) => self.file.append(record)?,
            Err(error) => {
                let data = &recording.data;
                print::note(format_args!("left out: scan {index} of {data}: {error}"));
                self.unreadable += 1;
                self.preparation.begin();
                return Ok(());
            }
        }
        if begins {
            let sequence = provenance::sequence(number, recording, truth, index);
            self.sequences.push(sequence);
        }
        self.sequences[number].1 += 1;
        Ok(())
    }

    /// Returns what was written, in words.
    fn counts(&self) -> String {
        let scans: usize = self.sequences.iter().map(|(_, scans)| scans).sum();
        let sequences = match self.sequences.len() {
            1 => "1 sequence".to_owned(),
            several => format!("{several} sequences"),
        };
        let left_out = match (self.unreadable, self.without_truth) {
            (0, 0) => String::new(),
            (unreadable, untrue) => {
                format!(" (left out: {unreadable} unreadable, {untrue} without truth)")
            }
        };
        format!("{scans} scans in {sequences}{left_out}")
    }
}
