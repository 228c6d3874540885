//! The lines that are appended to a log of a run, as to its `log.jsonl`.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use serde_json::Value;

use crate::LogLine;

/// The most that is read at once, bytes; a longer line is not of the log.
const MAX_BYTES: u64 = 1 << 20;

pub struct LogTail {
    path: PathBuf,
    offset: u64,
}

impl LogTail {
    /// Begins at the present end.
    pub fn new(path: &Path) -> Self {
        Self {
            offset: path.metadata().map_or(0, |file| file.len()),
            ..Self::whole(path)
        }
    }

    /// Begins with the first line.
    pub fn whole(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            offset: 0,
        }
    }

    /// Returns the events that were appended since the last call.
    pub fn lines(&mut self, now_ns: i64) -> Vec<LogLine> {
        let lines = self.texts();
        lines
            .iter()
            .filter_map(|line| parse(line, now_ns))
            .collect()
    }

    /// Returns the lines that were completed since the last call. A log that cannot be read has
    /// none: it may come later.
    pub fn texts(&mut self) -> Vec<String> {
        self.read().unwrap_or_default()
    }

    fn read(&mut self) -> io::Result<Vec<String>> {
        let mut file = File::open(&self.path)?;
        if file.metadata()?.len() < self.offset {
            // It had become too long, and was emptied.
            self.offset = 0;
        }
        file.seek(SeekFrom::Start(self.offset))?;
        let mut reader = BufReader::new(file.take(MAX_BYTES));
        let (mut line, mut lines) = (Vec::new(), Vec::new());
        while reader.read_until(b'\n', &mut line)? > 0 {
            let is_whole = line.ends_with(b"\n");
            if !is_whole && (line.len() as u64) < MAX_BYTES {
                break;
            }
            self.offset += line.len() as u64;
            lines.push(String::from_utf8_lossy(line.trim_ascii_end()).into_owned());
            line.clear();
        }
        Ok(lines)
    }
}

/// Parses a line; `None` if the line is not from the log.
fn parse(line: &str, now_ns: i64) -> Option<LogLine> {
    let line: Value = serde_json::from_str(line).ok()?;
    let text = |value: &Value| match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let fields = line.get("fields")?.as_object()?;
    let mut message = fields.get("message").map(text).unwrap_or_default();
    for (key, value) in fields.iter().filter(|(key, _)| *key != "message") {
        message += &format!(" {key}={}", text(value));
    }
    Some(LogLine {
        written_ns: now_ns,
        level: text(line.get("level")?),
        stage: line.pointer("/span/stage").map(text).unwrap_or_default(),
        message,
    })
}

#[cfg(test)]
mod tests {
    use std::{fs::OpenOptions, io::Write};

    use super::*;

    #[test]
    fn whole_lines_that_are_appended_are_returned_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.jsonl");
        let append = |text: &str| {
            let mut log = OpenOptions::new()
                .create(true)
                .append(true)
                .open(&path)
                .unwrap();
            log.write_all(text.as_bytes()).unwrap();
        };
        append("{\"level\":\"INFO\",\"fields\":{\"message\":\"before\"}}\n");
        let mut tail = LogTail::new(&path);
        assert_eq!(tail.lines(5), []);
        append("{\"level\":\"WARN\",\"fields\":{\"message\":\"skipped\",\"scan\":7},");
        assert_eq!(tail.lines(6), []);
        append("\"span\":{\"stage\":\"masking\"}}\nnonsense\n");
        let line = LogLine {
            written_ns: 7,
            level: "WARN".to_owned(),
            stage: "masking".to_owned(),
            message: "skipped scan=7".to_owned(),
        };
        assert_eq!(tail.lines(7), [line]);
        let endless = "x".repeat(MAX_BYTES as usize);
        for _ in 0..3 {
            append(&endless);
            assert_eq!(tail.lines(8), []);
        }
        append("\n{\"level\":\"INFO\",\"fields\":{\"message\":\"after it\"}}\n");
        assert_eq!(tail.lines(8)[0].message, "after it");
        std::fs::write(&path, "").unwrap();
        assert_eq!(tail.lines(8), []);
        append("{\"level\":\"INFO\",\"fields\":{}}\n");
        assert_eq!(tail.lines(9).len(), 1);
    }
}
