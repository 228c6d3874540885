//! Computes the drives of a batch, several at once.

use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs::{File, OpenOptions},
    io::{self, Read, Seek, SeekFrom},
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{self, Command, ExitStatus, Stdio},
    time::Duration,
};

use gyre_stage::wake::Signals;
use gyre_supervise::last_line;
use gyre_terminal::Failure;
use rustix::process::{Pid, Signal, kill_process};

use crate::batch::{Drive, End, List, Outcome, Row, Settings, list::is_configuration};

pub const COMMAND: &str = "batch-drive";
/// The longest time between two polls of the processes; the end of one is noticed at once.
const POLL_PERIOD: Duration = Duration::from_secs(1);
/// Bytes at the end of an output that hold its last line.
const TAIL: u64 = 1 << 16;

#[derive(Clone, Debug)]
pub struct Batch<'a> {
    pub program: PathBuf,
    pub list: &'a List,
    pub drives: Vec<Drive>,
    pub settings: Settings,
    /// The folder of the batch, an absolute path without links.
    pub out: PathBuf,
    pub jobs: usize,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ended {
    pub counts: BTreeMap<Outcome, usize>,
    /// The number of drives that had been computed before.
    pub earlier: usize,
    /// True if the batch was interrupted before its end.
    pub interrupted: bool,
}

/// Computes all drives, and writes the row of each when it has ended. The callback receives a line
/// for each drive. A request to stop and an error end the runs; their results so far are kept.
pub fn compute(
    batch: &Batch<'_>,
    signals: &Signals,
    say: &mut dyn FnMut(&str),
) -> Result<Ended, Failure> {
    for name in ["drives", "output", "rows"] {
        gyre_storage::create_folder(&batch.out.join(name))?;
    }
    let mut ended = Ended::default();
    let mut waiting = batch.drives.iter();
    let mut running: Vec<Child<'_>> = Vec::new();
    loop {
        while running.len() < batch.jobs.max(1)
            && let Some(drive) = waiting.next()
        {
            running.push(Child::start(batch, drive)?);
        }
        if running.is_empty() {
            return Ok(ended);
        }
        ended.interrupted = signals.sleep(POLL_PERIOD)?;
        if ended.interrupted {
            // All at once, since each may have results to write.
            running.iter_mut().for_each(Child::ask_to_end);
        }
        let mut rest = Vec::new();
        for mut child in running {
            let status = match ended.interrupted {
                true => Some(child.process.wait()?),
                false => child.process.try_wait()?,
            };
            match status {
                Some(status) => {
                    let end = child.end(status, &batch.out, ended.interrupted);
                    say(&ended.add(batch, child.drive, end)?);
                }
                None => rest.push(child),
            }
        }
        if ended.interrupted {
            return Ok(ended);
        }
        running = rest;
    }
}

impl Ended {
    fn add(&mut self, batch: &Batch<'_>, drive: &Drive, end: End) -> Result<String, Failure> {
        let Batch { settings, out, .. } = batch;
        let (mut row, mut note) = (Row::read(out, drive, settings)?, String::new());
        let is_kept = row.outcome.has_results() && end.unchecked;
        if is_kept {
            note = format!("; not looked at again: {}", end.sentence);
        } else {
            row = Row::of(out, drive, settings, end.outcome, end.sentence);
            row.write(out)?;
        }
        let earlier = is_kept || end.earlier;
        *self.counts.entry(row.outcome).or_default() += 1;
        self.earlier += usize::from(earlier);
        let number: usize = self.counts.values().sum();
        let (all, line) = (batch.drives.len(), row.line(earlier));
        Ok(format!("[{number}/{all}] {line}{note}"))
    }
}

/// The process of a drive. It is ended when this is dropped.
struct Child<'a> {
    drive: &'a Drive,
    process: process::Child,
    output: File,
    /// Bytes of the output before the output of this process.
    begin: u64,
}

impl<'a> Child<'a> {
    /// Starts it. Its output is added to `output/NAME.txt`.
    fn start(batch: &Batch<'_>, drive: &'a Drive) -> Result<Self, Failure> {
        let path = batch.out.join("output").join(format!("{}.txt", drive.name));
        let unwritable = |error: io::Error| format!("cannot write to {}: {error}", path.display());
        let mut options = OpenOptions::new();
        let output = options.create(true).append(true).read(true).open(&path);
        let output = output.map_err(unwritable)?;
        let begin = output.metadata().map_err(unwritable)?.len();
        let out = output.try_clone().map_err(unwritable)?;
        let errors = output.try_clone().map_err(unwritable)?;
        let process = Command::new(&batch.program)
            .args(words(batch, drive))
            .stdin(Stdio::null())
            .stdout(out)
            .stderr(errors)
            .spawn()
            .map_err(|error| format!("cannot start `{}`: {error}", batch.program.display()))?;
        Ok(Self {
            drive,
            process,
            output,
            begin,
        })
    }

    fn ask_to_end(&mut self) {
        if matches!(self.process.try_wait(), Ok(None)) {
            let _ = kill_process(Pid::from_child(&self.process), Signal::TERM);
        }
    }

    /// Returns the end of the process: its last line, or the cause of its death.
    fn end(&self, status: ExitStatus, out: &Path, stopped: bool) -> End {
        let printed = self.printed().unwrap_or_default();
        let last = last_line(&printed).unwrap_or_default();
        match (status.signal(), serde_json::from_str::<End>(last)) {
            (None, Ok(end)) => End {
                // Without the place of the batch the table is the same in each place.
                sentence: end.sentence.replace(&format!("{}/", out.display()), ""),
                ..end
            },
            // It was asked to end before it had anything to write.
            (Some(_), _) if stopped => End::interrupted(),
            (Some(signal), _) => End::of(
                Outcome::Killed,
                format!("its supervisor was killed by signal {signal}: the same command continues"),
            ),
            (None, Err(_)) if last.is_empty() => End::of(Outcome::Failed, "it printed nothing"),
            (None, Err(_)) => End::of(Outcome::Failed, last),
        }
    }

    fn printed(&self) -> io::Result<String> {
        let (mut file, mut bytes) = (&self.output, Vec::new());
        let tail = file.metadata()?.len().saturating_sub(TAIL);
        file.seek(SeekFrom::Start(self.begin.max(tail)))?;
        file.take(TAIL).read_to_end(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

impl Drop for Child<'_> {
    fn drop(&mut self) {
        self.ask_to_end();
        let _ = self.process.wait();
    }
}

fn words(batch: &Batch<'_>, drive: &Drive) -> Vec<OsString> {
    let mut out = OsString::from("--out=");
    out.push(Row::results(&batch.out, drive));
    let path = batch.list.resolve(&drive.path);
    let own = drive.configuration.as_deref();
    let own = own.map(|named| match batch.list.resolve(named) {
        file if file.is_file() => file,
        file => gyre_shipped::configuration(Path::new(named)).unwrap_or(file),
    });
    let mut words = vec![
        COMMAND.into(),
        format!("--parent={}", process::id()).into(),
        out,
    ];
    if !is_configuration(&drive.path) {
        let configuration = own.or_else(|| batch.settings.configuration.clone());
        words.extend(configuration.map(PathBuf::into_os_string));
    }
    words.push(path.into());
    let set = batch.settings.set.iter().chain(&drive.set);
    words.extend(set.map(|sentence| format!("--set={sentence}").into()));
    words
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use super::*;

    fn batch<'a>(list: &'a List, out: &Path, program: &str) -> Batch<'a> {
        fs::create_dir_all(out.join("output")).unwrap();
        Batch {
            program: program.into(),
            list,
            drives: list.drives.clone(),
            settings: Settings {
                configuration: Some("/all.toml".into()),
                set: vec!["raster.n=127".to_owned()],
            },
            out: out.to_owned(),
            jobs: 1,
        }
    }

    fn list(folder: &Path, text: &str) -> List {
        let path = folder.join("list.csv");
        fs::write(&path, text).unwrap();
        List::read(&path).unwrap()
    }

    #[test]
    fn a_drive_is_a_run_with_its_configuration_or_that_of_the_batch() {
        let folder = tempfile::tempdir().unwrap();
        let text = "drive,configuration,set\n/a,,\n/b,/own.toml,raster.n=63\n/c.toml,,\n";
        let list = list(folder.path(), text);
        let batch = batch(&list, folder.path(), "gyre");
        let of = |index: usize| words(&batch, &list.drives[index])[3..].to_vec();
        assert_eq!(of(0), ["/all.toml", "/a", "--set=raster.n=127"]);
        let own = ["/own.toml", "/b", "--set=raster.n=127", "--set=raster.n=63"];
        assert_eq!(of(1), own);
        assert_eq!(of(2), ["/c.toml", "--set=raster.n=127"]);
    }

    /// Returns the end of a drive whose program is a shell script.
    fn end_of(script: &str) -> End {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("program");
        fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let list = list(folder.path(), "a\n");
        let batch = batch(&list, folder.path(), program.to_str().unwrap());
        // An earlier attempt has left its output.
        fs::write(folder.path().join("output/a.txt"), "earlier\n").unwrap();
        let mut child = Child::start(&batch, &list.drives[0]).unwrap();
        let status = child.process.wait().unwrap();
        child.end(status, Path::new("/batch"), false)
    }

    #[test]
    fn an_end_is_the_last_line_or_the_cause_of_the_death() {
        let reported = End::of(Outcome::Corrupt, "no /batch/drives/a");
        let json = serde_json::to_string(&reported).unwrap();
        let corrupt = format!("echo words; echo '{json}'");
        for (script, outcome, sentence) in [
            (&*corrupt, Outcome::Corrupt, "no drives/a"),
            ("echo some words; exit 101", Outcome::Failed, "some words"),
            ("exit 1", Outcome::Failed, "it printed nothing"),
        ] {
            assert_eq!(end_of(script), End::of(outcome, sentence));
        }
        let end = end_of(&format!("echo '{json}'; kill -9 $$"));
        assert_eq!(end.outcome, Outcome::Killed);
        assert!(end.sentence.contains("signal 9"), "{}", end.sentence);
    }
}
