//! `gyre logs`: the events of a run's processes and their printed lines, as lines for a person.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Seek, SeekFrom},
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use gyre_configuration::process_names;
use gyre_stage::{control::Control, wake::Signals};
use gyre_terminal::{Failure, print};

use crate::operate::{arguments::LogsArguments, events};

/// Time between two looks at the files.
const PERIOD: Duration = Duration::from_millis(200);

/// Prints the newest lines of a run's logs, even after its end, and continues with new lines if
/// asked to.
pub fn logs(arguments: &LogsArguments) -> Result<ExitCode, Failure> {
    let process = arguments.process.as_deref();
    let run = arguments.run.run.as_deref();
    let (process, out) = match process.filter(|it| Path::new(it).is_dir()) {
        // A run alone, or before the process: `gyre logs out/demo`, `gyre logs out/demo masking`.
        Some(folder) if run.is_none_or(|run| !run.is_dir()) => {
            (run.and_then(Path::to_str), folder.into())
        }
        _ => (process, arguments.run.folder()?),
    };
    let mut logs = open(&out, process)?;
    // Of each log: printed lines have no time for sorting them among the events.
    for log in &mut logs {
        let lines = log.lines();
        let first = lines.len().saturating_sub(arguments.lines);
        lines[first..].iter().try_for_each(print::line)?;
    }
    let signals = Signals::install()?;
    let run = Control::of(&out);
    if let Err(ended) = &run {
        print::note(format_args!("gyre: {ended}"));
    }
    let run = run.ok().filter(|_| arguments.follow);
    while let Some(run) = &run {
        // Before the logs: lines that are written last are still printed.
        let is_there = run.is_there();
        let mut lines = logs.iter_mut().flat_map(Log::lines);
        lines.try_for_each(print::line)?;
        if !is_there || signals.sleep(PERIOD)? {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the logs to print: the events, and what processes print themselves, which is little.
fn open(out: &Path, process: Option<&str>) -> Result<Vec<Log>, Failure> {
    let events = out.join("log.jsonl");
    if !events.exists() {
        let out = out.display();
        return Err(format!("no run has written to {out}: it has no log.jsonl").into());
    }
    let mut names = process_names();
    // `gyre` is the supervisor's output, where it runs in the background.
    names.extend(["recorder", "supervisor", "gyre"]);
    if let Some(process) = process
        && !names.contains(&process)
    {
        let names = names.join(", ");
        return Err(format!("there is no process `{process}`; there are {names}").into());
    }
    let printed = names
        .into_iter()
        .filter(|name| process.is_none_or(|process| process == *name))
        .map(|name| Log {
            path: out.join("log").join(format!("{name}.txt")),
            kind: Kind::Printed(name.to_owned()),
            position: None,
        });
    let mut logs: Vec<Log> = printed.filter(|log| log.path.exists()).collect();
    logs.push(Log {
        path: events,
        kind: Kind::Events(process.map(str::to_owned)),
        position: None,
    });
    Ok(logs)
}

struct Log {
    path: PathBuf,
    kind: Kind,
    /// The file that was read last, by its inode, and how far.
    position: Option<(u64, u64)>,
}

enum Kind {
    /// `log.jsonl`, of one process or of all.
    Events(Option<String>),
    /// The output of a process.
    Printed(String),
}

impl Log {
    /// Returns the complete lines since the last call. A log that cannot be read has none: it may
    /// come later.
    fn lines(&mut self) -> Vec<String> {
        self.read().unwrap_or_default()
    }

    fn read(&mut self) -> io::Result<Vec<String>> {
        let mut file = File::open(&self.path)?;
        let (inode, length) = (file.metadata()?.ino(), file.metadata()?.len());
        // A log that has become too long is emptied.
        let begin = self.position.filter(|(i, at)| *i == inode && *at <= length);
        let mut position = begin.map_or(0, |(_, at)| at);
        file.seek(SeekFrom::Start(position))?;
        let (mut reader, mut bytes, mut lines) = (BufReader::new(file), Vec::new(), Vec::new());
        while reader.read_until(b'\n', &mut bytes)? > 0 {
            // The rest of the last line is not written yet.
            if bytes.last() != Some(&b'\n') {
                break;
            }
            position += bytes.len() as u64;
            lines.extend(self.line(&String::from_utf8_lossy(&bytes)));
            bytes.clear();
        }
        self.position = Some((inode, position));
        Ok(lines)
    }

    /// Returns a line for a person; `None` if it is of another process.
    fn line(&self, line: &str) -> Option<String> {
        match &self.kind {
            Kind::Events(process) => events::readable(line.trim_end(), process.as_deref()),
            Kind::Printed(process) => Some(format!("{process}: {}", line.trim_end())),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{fs::OpenOptions, io::Write};

    use super::*;

    #[test]
    fn lines_are_read_once_and_when_they_are_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("masking.txt");
        let mut log = Log {
            path: path.clone(),
            kind: Kind::Printed("masking".to_owned()),
            position: None,
        };
        assert!(log.lines().is_empty(), "it is not there yet");
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .unwrap();
        file.write_all(b"one\ntw").unwrap();
        assert_eq!(log.lines(), ["masking: one"]);
        file.write_all(b"o\n").unwrap();
        assert_eq!(log.lines(), ["masking: two"]);
        file.set_len(0).unwrap();
        file.write_all(b"3\n").unwrap();
        assert_eq!(log.lines(), ["masking: 3"], "it was emptied meanwhile");
    }
}
