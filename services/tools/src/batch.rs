//! Batches: a run for each of many drives, and a table of their results.
//!
//! Each drive is a process, a `gyre run` that ends with this one. The state of a batch is its runs
//! and a [`Row`] for each drive: the same command continues, whatever was killed. Tasks of a batch
//! share only the folder, so that they can run on many computers.

pub mod list;
pub mod table;

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    mem,
    os::unix::process::ExitStatusExt,
    path::Path,
    process::{self, Command, ExitStatus, Stdio},
    time::Duration,
};

use gyre_client::{RunError, Signals, last_line};
use gyre_configuration::terminal::{Failure, own, print};
use rustix::process::{Pid, Signal, kill_process};

pub use list::{Drive, List};
pub use table::{End, Outcome, Row};

pub const COMMAND: &str = "batch-drive";
/// The longest time between two polls of the processes; the end of one is noticed at once.
const POLL_PERIOD: Duration = Duration::from_secs(1);

/// Computes all drives, writes the row of each when it has ended, and prints a line about it. A
/// request to stop and an error end the runs; their results so far are kept. `out`: the folder of
/// the batch, an absolute path without links. Returns the number of drives that had been computed
/// before, and whether the batch was interrupted.
pub fn compute(list: &List, out: &Path, jobs: usize) -> Result<(usize, bool), Failure> {
    let signals = Signals::install()?;
    for name in ["drives", "output", "rows"] {
        gyre_storage::create_folder(&out.join(name))?;
    }
    let (mut number, mut earlier, mut interrupted) = (0, 0, false);
    let mut waiting = list.drives.iter();
    let mut running: Vec<Child<'_>> = Vec::new();
    loop {
        while !interrupted
            && running.len() < jobs
            && let Some(drive) = waiting.next()
        {
            let path = out.join("output").join(format!("{}.txt", drive.name));
            let child = Child::start(drive, command(list, out, drive), &path);
            running.push(child.map_err(RunError::file(&path))?);
        }
        if running.is_empty() {
            return Ok((earlier, interrupted));
        }
        if signals.sleep(POLL_PERIOD)? && !interrupted {
            interrupted = true;
            // All at once, since each may have results to write.
            running.iter_mut().for_each(Child::ask_to_end);
        }
        for mut child in mem::take(&mut running) {
            let Some(status) = child.process.try_wait()? else {
                running.push(child);
                continue;
            };
            let end = child.end(status, interrupted);
            let (mut row, mut note) = (Row::read(out, child.drive), String::new());
            let is_unchecked = end.earlier && !end.outcome.has_results();
            if is_unchecked && row.outcome.has_results() {
                note = format!("; not looked at again: {}", end.sentence);
            } else {
                row = Row::of(out, child.drive, end.outcome, end.sentence);
                row.write(out)?;
            }
            let is_earlier = end.earlier && row.outcome.has_results();
            earlier += usize::from(is_earlier);
            number += 1;
            let (all, line) = (list.drives.len(), row.line(is_earlier));
            print::note(format_args!("[{number}/{all}] {line}{note}"));
        }
    }
}

/// The process of a drive. It is ended when this is dropped.
struct Child<'a> {
    drive: &'a Drive,
    process: process::Child,
    /// The output of this process; the outputs of earlier processes precede it.
    output: File,
}

impl<'a> Child<'a> {
    /// Starts it, and adds its output to a file.
    fn start(drive: &'a Drive, mut command: Command, path: &Path) -> io::Result<Self> {
        let out = File::options().create(true).append(true).open(path)?;
        let errors = out.try_clone()?;
        let mut output = File::open(path)?;
        output.seek(SeekFrom::End(0))?;
        command.stdin(Stdio::null()).stdout(out).stderr(errors);
        Ok(Self {
            drive,
            process: command.spawn()?,
            output,
        })
    }

    fn ask_to_end(&mut self) {
        if matches!(self.process.try_wait(), Ok(None)) {
            let _ = kill_process(Pid::from_child(&self.process), Signal::TERM);
        }
    }

    /// Returns the end of the process: its last line, or the cause of its death.
    fn end(&self, status: ExitStatus, stopped: bool) -> End {
        let mut bytes = Vec::new();
        let _ = (&self.output).read_to_end(&mut bytes);
        let printed = String::from_utf8_lossy(&bytes);
        let last = last_line(&printed).unwrap_or("it printed nothing");
        match (status.signal(), serde_json::from_str(last)) {
            (None, Ok(end)) => end,
            (None, Err(_)) => End::new(Outcome::Failed, false, last),
            // It was asked to end before it had anything to write.
            (Some(_), _) if stopped => End::interrupted(),
            (Some(signal), _) => End::new(
                Outcome::Killed,
                false,
                format!("its supervisor was killed by signal {signal}: the same command continues"),
            ),
        }
    }
}

impl Drop for Child<'_> {
    fn drop(&mut self) {
        self.ask_to_end();
        let _ = self.process.wait();
    }
}

/// Returns the command of a drive, which knows the process that starts it.
fn command(list: &List, out: &Path, drive: &Drive) -> Command {
    let configuration = drive.configuration.as_deref();
    let configuration = configuration.map(|named| match list.resolve(named) {
        file if file.is_file() => file,
        _ if gyre_storage::shipped::is_own(named) => named.to_owned(),
        file => gyre_storage::shipped::configuration(named).unwrap_or(file),
    });
    let mut command = Command::new(own());
    command.arg(COMMAND);
    command.arg(format!("--parent={}", process::id()));
    command.arg("--out").arg(Row::results(out, drive));
    command.args(configuration).arg(list.resolve(&drive.path));
    command.args(drive.set.iter().map(|key| format!("--set={key}")));
    command
}

#[cfg(test)]
mod tests {
    use std::{ffi::OsStr, fs};

    use super::*;

    fn list(folder: &Path, text: &str) -> List {
        let path = folder.join("list.csv");
        fs::write(&path, text).unwrap();
        List::read(&path).unwrap()
    }

    #[test]
    fn a_drive_is_a_run_with_its_configuration_or_that_of_the_batch() {
        let folder = tempfile::tempdir().unwrap();
        let text = "drive,configuration,set\n/a,,\n/b,/own.toml,raster.n=63\n/c.toml,,\n";
        let set = ["raster.n=127".to_owned()];
        let list = list(folder.path(), text).with(Some(Path::new("/all.toml")), &set);
        let of = |index: usize| {
            let command = command(&list, folder.path(), &list.drives[index]);
            let words: Vec<_> = command.get_args().map(OsStr::to_owned).collect();
            words[4..].to_vec()
        };
        assert_eq!(of(0), ["/all.toml", "/a", "--set=raster.n=127"]);
        let own = ["/own.toml", "/b", "--set=raster.n=127", "--set=raster.n=63"];
        assert_eq!(of(1), own);
        assert_eq!(of(2), ["/c.toml", "--set=raster.n=127"]);
    }

    /// Returns the end of a drive whose program is a shell script.
    fn end_of(script: &str) -> End {
        let folder = tempfile::tempdir().unwrap();
        let list = list(folder.path(), "a\n");
        let mut program = Command::new("sh");
        program.args(["-c", script]);
        // An earlier attempt has left its output.
        let output = folder.path().join("a.txt");
        fs::write(&output, "earlier\n").unwrap();
        let mut child = Child::start(&list.drives[0], program, &output).unwrap();
        let status = child.process.wait().unwrap();
        child.end(status, false)
    }

    #[test]
    fn an_end_is_the_last_line_or_the_cause_of_the_death() {
        let reported = End::new(Outcome::Interrupted, false, "no scans");
        let json = serde_json::to_string(&reported).unwrap();
        let interrupted = format!("echo words; echo '{json}'");
        for (script, outcome, sentence) in [
            (&*interrupted, Outcome::Interrupted, "no scans"),
            ("echo some words; exit 101", Outcome::Failed, "some words"),
            ("exit 1", Outcome::Failed, "it printed nothing"),
        ] {
            assert_eq!(end_of(script), End::new(outcome, false, sentence));
        }
        let end = end_of(&format!("echo '{json}'; kill -9 $$"));
        assert_eq!(end.outcome, Outcome::Killed);
        assert!(end.sentence.contains("signal 9"), "{}", end.sentence);
    }
}
