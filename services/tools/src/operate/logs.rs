//! `gyre logs`: the events of a run's processes and their printed lines, as lines for a person.

use std::{path::Path, time::Duration};

use clap::Args;
use gyre_client::{Signals, control::Control};
use gyre_configuration::{
    process_names,
    terminal::{Failure, print},
};
use gyre_recording::LogTail;
use serde_json::Value;

use crate::operate::RunChoice;

#[derive(Debug, Args)]
pub struct LogsArguments {
    /// The process, as masking. Default: all.
    pub process: Option<String>,
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// Continue with new lines, until the run ends.
    #[arg(short, long)]
    pub follow: bool,
    /// Number of lines to begin with, of each log.
    #[arg(short = 'n', long, default_value_t = 50)]
    pub lines: usize,
}

const PERIOD: Duration = Duration::from_millis(200);

/// Prints the newest lines of a run's logs, even after its end, and continues with new lines if
/// asked to.
pub fn logs(arguments: &LogsArguments) -> Result<(), Failure> {
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
    Ok(())
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
    names.retain(|name| process.is_none_or(|process| process == *name));
    let log = |path: &Path, printed_by: Option<&str>| Log {
        tail: LogTail::whole(path),
        printed_by: printed_by.map(str::to_owned),
        process: process.map(str::to_owned),
    };
    let path = |name: &str| out.join("log").join(format!("{name}.txt"));
    let printed = names.iter().map(|name| (path(name), Some(*name)));
    let printed = printed.filter(|(path, _)| path.exists());
    let all = printed.chain([(events, None)]);
    Ok(all.map(|(path, name)| log(&path, name)).collect())
}

struct Log {
    tail: LogTail,
    /// The process that has printed it; `None`: it is `log.jsonl`.
    printed_by: Option<String>,
    /// The process whose events are printed; `None`: all.
    process: Option<String>,
}

impl Log {
    /// Returns the complete lines since the last call.
    fn lines(&mut self) -> Vec<String> {
        let mut lines = Vec::new();
        loop {
            let appended = self.tail.texts();
            if appended.is_empty() {
                return lines;
            }
            lines.extend(appended.iter().filter_map(|line| self.line(line)));
        }
    }

    /// Returns a line for a person; `None` if it is of another process.
    fn line(&self, line: &str) -> Option<String> {
        match &self.printed_by {
            Some(process) => Some(format!("{process}: {}", line.trim_end())),
            None => readable(line.trim_end(), self.process.as_deref()),
        }
    }
}

/// Returns an event as a line: `21:04:05.678 WARN masking: sentence, key=value`; `None` if it is of
/// another process than `process`, or is no event.
fn readable(line: &str, process: Option<&str>) -> Option<String> {
    let event: Value = serde_json::from_str(line).ok()?;
    let text = |place| event.pointer(place).and_then(Value::as_str);
    let stage = text("/span/stage").unwrap_or_default();
    if process.is_some_and(|process| process != stage) {
        return None;
    }
    let (time, level) = (text("/timestamp")?, text("/level")?);
    let fields = event.get("fields")?.as_object()?;
    let message = text("/fields/message").unwrap_or_default();
    let others = fields.iter().filter(|(key, _)| *key != "message");
    let others: String = others
        .map(|(key, value)| format!(", {key}={value}"))
        .collect();
    // The time of day to the millisecond of `2026-11-23T21:04:05.678901Z`.
    let clock = time.split_once('T').map_or(time, |(_, day)| day);
    let clock = clock.get(..12).unwrap_or(clock);
    Some(format!("{clock} {level} {stage}: {message}{others}"))
}

#[cfg(test)]
mod tests {
    use std::{fs::OpenOptions, io::Write};

    use super::*;

    #[test]
    fn lines_are_read_once_and_when_they_are_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("masking.txt");
        let mut log = Log {
            tail: LogTail::whole(&path),
            printed_by: Some("masking".to_owned()),
            process: None,
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

    const LINE: &str = r#"{"timestamp":"2026-11-23T21:04:05.678901Z","level":"WARN","fields":{"message":"skipped: it is damaged","scan":7},"target":"source","span":{"stage":"radar-replay","name":"process"},"spans":[]}"#;

    #[test]
    fn an_event_is_a_line_with_its_time_its_process_and_its_fields() {
        let line = "21:04:05.678 WARN radar-replay: skipped: it is damaged, scan=7";
        assert_eq!(readable(LINE, None).as_deref(), Some(line));
        assert_eq!(readable(LINE, Some("radar-replay")).as_deref(), Some(line));
        assert_eq!(readable(LINE, Some("masking")), None);
        assert_eq!(readable("{", None), None);
        assert_eq!(readable("[]", None), None);
    }
}
