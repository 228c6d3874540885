//! Fuzzing of everything that Gyre reads. A test in `tests/` is a target: of each edit of a small
//! valid input it asserts that nothing panics, that memory stays within the target's limit, and
//! that a rejection is one sentence.
//!
//! `cargo test` runs each target for a second. For longer, by name, one at a time:
//! `BOLERO_RANDOM_TEST_TIME_MS=600000 cargo test --release -p gyre-fuzz -- --nocapture pixels`.
//! A failure prints the edits, shrunk, and the seed that repeats it.

pub mod edit;

use std::{
    error::Error,
    fmt::Display,
    sync::{Mutex, MutexGuard, PoisonError},
};

use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Targets run one at a time, since memory is counted for the whole process.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// The longest sentence, bytes. Paths of temporary files are part of it.
const LONGEST_SENTENCE: usize = 1000;

pub struct Target {
    limit_bytes: usize,
    _alone: MutexGuard<'static, ()>,
}

impl Target {
    /// Starts a target whose inputs may each take this much memory, MB.
    pub fn new(limit_mb: usize) -> Self {
        Self {
            limit_bytes: limit_mb << 20,
            _alone: ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner),
        }
    }

    pub fn run<E: Display>(&self, execute: impl FnOnce() -> Result<(), E>) {
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let result = execute();
        let bytes = MEMORY.peak_usage().saturating_sub(before);
        let most = self.limit_bytes;
        assert!(bytes <= most, "{bytes} bytes of memory, more than {most}");
        if let Err(error) = result {
            assert_sentence(&error);
        }
    }
}

pub type Failure = Box<dyn Error + Send + Sync>;

/// Asserts that an error is one sentence for a person: one line that is not too long, without the
/// marks of a debugging format.
pub fn assert_sentence(error: &impl Display) {
    let text = error.to_string();
    assert!(!text.trim().is_empty(), "an empty error");
    let bytes = text.len();
    assert!(bytes <= LONGEST_SENTENCE, "{bytes} bytes: {text:.200}");
    // Other control characters of names and words are replaced where the sentence is printed.
    assert!(!text.contains(['\n', '\r']), "{text:?}");
    // Quoted text is part of the input.
    let said: String = text.replace(r#"\""#, "").split('"').step_by(2).collect();
    for mark in ["Some(", "Ok(", "Err(", " { "] {
        assert!(!said.contains(mark), "{text}");
    }
    // As a word: names of temporary folders are random letters.
    let mut words = said.split(|letter: char| !letter.is_alphanumeric());
    assert!(words.all(|word| word != "None"), "{text}");
}
