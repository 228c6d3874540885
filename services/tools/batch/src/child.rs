//! The process of a drive, from its start to its last sentence.

use std::{
    ffi::OsString,
    fs::{File, OpenOptions},
    io::{Read, Seek, SeekFrom},
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{self, Command, ExitStatus, Stdio},
};

use gyre_supervise::last_line;
use rustix::process::{Pid, Signal, kill_process};

use crate::{BatchError, Drive, DriveOutcome, batch::Batch, list::is_configuration};

/// The command of `gyre` that computes a drive.
pub const COMMAND: &str = "batch-drive";
/// The start of a sentence of `gyre`.
const PREFIX: &str = "gyre: ";
/// Bytes at the end of an output in which the last sentence is looked for.
const TAIL: u64 = 1 << 16;

/// The end of a process.
pub(crate) struct End {
    pub outcome: DriveOutcome,
    /// True if the drive had ended so before.
    pub earlier: bool,
    /// The reason why it is not complete.
    pub sentence: String,
    /// False if it could not be started.
    pub begun: bool,
}

impl End {
    /// Returns the end of a drive whose process cannot be started since a disk or memory is full.
    ///
    /// # Errors
    /// Any other reason.
    pub fn of_full(error: BatchError) -> Result<Self, BatchError> {
        let sentence = error.to_string();
        let outcome = DriveOutcome::of_full(&sentence).ok_or(error)?;
        Ok(Self {
            outcome,
            earlier: false,
            sentence,
            begun: false,
        })
    }
}

/// The process of a drive. It is ended when this is dropped.
pub(crate) struct Child<'a> {
    pub drive: &'a Drive,
    process: process::Child,
    output: PathBuf,
    /// The place in the file of its output at which this process begins.
    begin: u64,
}

impl<'a> Child<'a> {
    /// Starts it. What it prints is added to `output/NAME.txt`.
    pub fn start(batch: &Batch<'_>, drive: &'a Drive) -> Result<Self, BatchError> {
        let output = batch.out.join("output").join(format!("{}.txt", drive.name));
        let opened = OpenOptions::new().create(true).append(true).open(&output);
        let file = opened.map_err(BatchError::file(&output))?;
        let begin = file.metadata().map_err(BatchError::file(&output))?.len();
        let errors = file.try_clone().map_err(BatchError::file(&output))?;
        let process = Command::new(&batch.program)
            .args(words(batch, drive))
            .stdin(Stdio::null())
            .stdout(file)
            .stderr(errors)
            .spawn()
            .map_err(|source| BatchError::Start {
                program: batch.program.clone(),
                source,
            })?;
        Ok(Self {
            drive,
            process,
            output,
            begin,
        })
    }

    /// Returns how it has ended, if it has.
    pub fn ended(&mut self, out: &Path) -> Option<End> {
        let status = self.process.try_wait().ok().flatten()?;
        Some(self.end(status, out, false))
    }

    /// Asks it to end, waits, and returns its end. Its results so far are kept.
    pub fn interrupt(&mut self, out: &Path) -> Result<End, BatchError> {
        self.ask_to_end();
        let status = self
            .process
            .wait()
            .map_err(BatchError::file(&self.output))?;
        Ok(self.end(status, out, true))
    }

    /// Asks it to end.
    pub fn ask_to_end(&mut self) {
        if let (Ok(None), Some(pid)) = (
            self.process.try_wait(),
            Pid::from_raw(self.process.id() as i32),
        ) {
            let _ = kill_process(pid, Signal::TERM);
        }
    }

    fn end(&self, status: ExitStatus, out: &Path, stopped: bool) -> End {
        let (outcome, earlier) = match (status.code(), status.signal()) {
            (Some(code), _) => DriveOutcome::of_exit_code(code),
            // It was asked to end before it had anything to write.
            (None, Some(_)) if stopped => (DriveOutcome::Interrupted, false),
            (None, _) => (DriveOutcome::Killed, false),
        };
        let sentence = match outcome {
            DriveOutcome::Complete => String::new(),
            DriveOutcome::Interrupted => {
                "the batch was interrupted: the same command goes on".to_owned()
            }
            DriveOutcome::Killed => format!(
                "its supervisor was killed by signal {}: the same command goes on",
                status.signal().unwrap_or_default()
            ),
            // Without the place of the batch the table is the same wherever it lies.
            _ => self
                .last_words()
                .replace(&format!("{}/", out.display()), ""),
        };
        End {
            outcome,
            earlier,
            sentence,
            begun: true,
        }
    }

    /// Returns the last sentence that it has printed.
    fn last_words(&self) -> String {
        let said = self.said().unwrap_or_default();
        let sentence = said
            .lines()
            .rev()
            .find_map(|line| line.strip_prefix(PREFIX));
        let sentence = sentence.or_else(|| last_line(&said));
        sentence.unwrap_or("it has said nothing").to_owned()
    }

    fn said(&self) -> std::io::Result<String> {
        let mut file = File::open(&self.output)?;
        let end = file.metadata()?.len();
        file.seek(SeekFrom::Start(self.begin.max(end.saturating_sub(TAIL))))?;
        let mut bytes = Vec::new();
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

/// The words of a drive's command: those of `gyre run`, after the process that it ends with.
fn words(batch: &Batch<'_>, drive: &Drive) -> Vec<OsString> {
    let path = batch.list.resolve(&drive.path);
    let own = drive.configuration.as_deref();
    let own = own.map(|named| match batch.list.resolve(named) {
        file if file.is_file() => file,
        file => gyre_shipped::configuration(Path::new(named)).unwrap_or(file),
    });
    let configuration = own.or_else(|| batch.settings.configuration.clone());
    let configuration = configuration.map(PathBuf::into_os_string);
    let mut words = vec![
        COMMAND.into(),
        format!("--parent={}", process::id()).into(),
        option("--out=", &batch.results(drive)),
    ];
    match is_configuration(&drive.path) {
        true => words.push(path.into()),
        false => words.extend(configuration.into_iter().chain([option("--data=", &path)])),
    }
    let set = batch.settings.set.iter().chain(&drive.set);
    words.extend(set.map(|sentence| format!("--set={sentence}").into()));
    words
}

fn option(name: &str, path: &Path) -> OsString {
    let mut word = OsString::from(name);
    word.push(path);
    word
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use super::*;
    use crate::{List, Settings};

    fn batch<'a>(list: &'a List, out: &Path, program: &str) -> Batch<'a> {
        fs::create_dir_all(out.join("output")).unwrap();
        Batch {
            program: program.into(),
            list,
            drives: list.drives().to_vec(),
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
        let of = |index: usize| words(&batch, &list.drives()[index])[3..].to_vec();
        assert_eq!(of(0), ["/all.toml", "--data=/a", "--set=raster.n=127"]);
        let own = [
            "/own.toml",
            "--data=/b",
            "--set=raster.n=127",
            "--set=raster.n=63",
        ];
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
        // The sentence of an earlier attempt is not that of this one.
        fs::write(folder.path().join("output/a.txt"), "gyre: earlier\n").unwrap();
        let mut child = Child::start(&batch, &list.drives()[0]).unwrap();
        let status = child.process.wait().unwrap();
        child.end(status, Path::new("/batch"), false)
    }

    #[test]
    fn a_full_disk_of_the_batch_is_the_end_of_a_drive_and_no_other_fault_is() {
        let fault = |number| {
            let source = std::io::Error::from_raw_os_error(number);
            BatchError::file("rows/a.json")(source)
        };
        for number in [28, 122] {
            let end = End::of_full(fault(number)).unwrap();
            assert_eq!((end.outcome, end.begun), (DriveOutcome::DiskFull, false));
            assert!(end.sentence.contains("rows/a.json"), "{}", end.sentence);
        }
        assert!(matches!(
            End::of_full(fault(5)),
            Err(BatchError::File { .. })
        ));
    }

    #[test]
    fn an_end_is_known_by_exit_code_and_last_sentence() {
        let missing = DriveOutcome::Missing.exit_code(false);
        let end = end_of(&format!(
            "echo 'gyre: no /batch/drives/a' >&2; echo end; exit {missing}"
        ));
        assert_eq!(end.outcome, DriveOutcome::Missing);
        assert_eq!(end.sentence, "no drives/a");
        let end = end_of("echo some words; exit 101");
        assert_eq!(
            (end.outcome, end.sentence.as_str()),
            (DriveOutcome::Failed, "some words")
        );
        let end = end_of("kill -9 $$");
        assert_eq!(end.outcome, DriveOutcome::Killed);
        assert!(end.sentence.contains("signal 9"), "{}", end.sentence);
        let end = end_of(&format!("exit {}", DriveOutcome::Complete.exit_code(true)));
        assert_eq!((end.outcome, end.earlier), (DriveOutcome::Complete, true));
        assert_eq!(end.sentence, "");
    }
}
