//! The output and the end of a command.

use std::process::{Command, ExitStatus};

#[derive(Clone, Debug)]
pub struct Ended {
    pub status: ExitStatus,
    pub stdout: String,
    pub stderr: String,
}

impl Ended {
    pub fn of(mut command: Command) -> Self {
        let output = command.env("RUST_BACKTRACE", "1").output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Self {
            status: output.status,
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    pub fn code(&self) -> Option<i32> {
        self.status.code()
    }

    pub fn succeeded(&self) -> &Self {
        assert!(self.status.success(), "{}\n{}", self.status, self.stderr);
        self.assert_calm();
        self
    }

    /// Asserts that the command failed with one sentence that contains all of these words.
    pub fn refused_with(&self, words: &[&str]) -> &Self {
        assert_eq!(
            self.stderr.lines().count(),
            1,
            "more than one sentence:\n{}",
            self.stderr
        );
        assert_eq!(self.stdout, "");
        self.failed_with(words)
    }

    /// Asserts that its last words were one sentence with all of these words, and that it failed.
    pub fn failed_with(&self, words: &[&str]) -> &Self {
        assert_eq!(self.code(), Some(1), "{}", self.stderr);
        self.assert_calm();
        let sentence = sentence_of(&self.stderr);
        assert!(
            !sentence.is_empty(),
            "no sentence begins with `gyre: `:\n{}",
            self.stderr
        );
        for word in words {
            assert!(sentence.contains(word), "`{word}` is not in: {sentence}");
        }
        self
    }

    /// Asserts that these words are in its messages.
    pub fn says(&self, words: &str) -> &Self {
        let said = &self.stderr;
        assert!(said.contains(words), "`{words}` is not in: {said}");
        self
    }

    pub fn does_not_say(&self, words: &str) -> &Self {
        assert!(!self.stderr.contains(words), "{}", self.stderr);
        self
    }

    /// Asserts that these words are in its output.
    pub fn prints(&self, words: &str) -> &Self {
        let printed = &self.stdout;
        assert!(printed.contains(words), "`{words}` is not in: {printed}");
        self
    }

    fn assert_calm(&self) {
        // A process without memory is aborted by Rust, and its last words, which are repeated, are
        // of a backtrace.
        let is_abort = |line: &&str| line.contains("died by signal 6 (");
        for text in [&self.stdout, &self.stderr] {
            let mut lines = text.lines().filter(|line| !is_abort(line));
            assert!(
                !lines.any(|line| line.contains("panicked") || line.contains("backtrace")),
                "{text}"
            );
        }
    }
}

/// The last line, if it is a message of the program; else nothing.
fn sentence_of(stderr: &str) -> &str {
    stderr
        .lines()
        .last()
        .and_then(|line| {
            line.strip_prefix("gyre: ")
                .or(line.strip_prefix("gyre-lab: "))
                .or(line.strip_prefix("gyre-changes: "))
        })
        .unwrap_or_default()
}
