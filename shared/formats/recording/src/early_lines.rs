//! Log lines that wait for the first message, whose time they are placed at.

use std::collections::VecDeque;

use crate::LogLine;

/// The most that is kept, bytes: a radar may be switched on days after the recorder.
const MAX_BYTES: usize = 1 << 20;

#[derive(Debug, Default)]
pub(crate) struct EarlyLines {
    lines: VecDeque<LogLine>,
    bytes: usize,
    left_out: u64,
}

impl EarlyLines {
    pub fn push(&mut self, line: LogLine) {
        self.bytes += bytes(&line);
        self.lines.push_back(line);
        while self.bytes > MAX_BYTES
            && let Some(oldest) = self.lines.pop_front()
        {
            self.bytes -= bytes(&oldest);
            self.left_out += 1;
        }
    }

    /// Returns the lines, preceded by a line with the number of omitted lines if there are any.
    pub fn into_lines(self) -> impl Iterator<Item = LogLine> {
        let left_out = (self.left_out > 0).then(|| LogLine {
            written_ns: self.lines.front().map_or(0, |line| line.written_ns),
            level: "WARN".to_owned(),
            stage: "recorder".to_owned(),
            message: format!(
                "{} lines before the first message are left out: log.jsonl of the run has them",
                self.left_out
            ),
        });
        left_out.into_iter().chain(self.lines)
    }
}

fn bytes(line: &LogLine) -> usize {
    size_of::<LogLine>() + line.level.len() + line.stage.len() + line.message.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_lines_are_kept_and_the_others_counted() {
        let line = |message: String| LogLine {
            message,
            ..LogLine::default()
        };
        let mut early = EarlyLines::default();
        early.push(line("first".to_owned()));
        let pushed = 5000;
        (0..pushed).for_each(|number| early.push(line(format!("{number:01000}"))));
        assert!(early.bytes <= MAX_BYTES);
        let lines: Vec<LogLine> = early.into_lines().collect();
        let kept = lines.len() - 1;
        assert!(kept > 500);
        let left_out = pushed + 1 - kept;
        assert!(lines[0].message.starts_with(&format!("{left_out} lines")));
        assert_eq!(lines[kept].message, format!("{:01000}", pushed - 1));
        let mut few = EarlyLines::default();
        few.push(line("only".to_owned()));
        assert_eq!(few.into_lines().count(), 1);
    }
}
