//! Fuzzing of everything that Gyre reads. A test in `tests/` is a target; each generates edits of
//! small valid inputs and asserts of every input that
//!
//! - nothing panics,
//! - memory stays within the target's limit,
//! - each rejection is one sentence.
//!
//! `cargo test` runs each target for a second. For longer, by name, one at a time:
//!
//! ```sh
//! BOLERO_RANDOM_TEST_TIME_MS=600000 cargo test --release -p gyre-fuzz -- --nocapture pixels
//! ```
//!
//! A failure prints the edits, shrunk, and the seed that repeats it. It becomes a test of the crate
//! that was at fault.
//!
//! - [`edit`]: edits of bytes and texts;
//! - [`recording`]: small recordings of all formats;
//! - [`Target`]: executes inputs.

pub mod edit;
pub mod recording;

use std::{
    error::Error,
    fmt::Display,
    io::Write,
    sync::{Mutex, MutexGuard, PoisonError},
};

use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Targets run one at a time, since memory is counted for the whole process.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// The longest sentence, bytes. Paths of temporary files are part of it.
const LONGEST_SENTENCE: usize = 1000;

/// A target that is being fuzzed.
pub struct Target {
    name: &'static str,
    limit_bytes: usize,
    counts: Mutex<Counts>,
    _alone: MutexGuard<'static, ()>,
}

#[derive(Default)]
struct Counts {
    executed: u64,
    refused: u64,
    peak_bytes: usize,
}

impl Target {
    /// Starts a target whose inputs may each take this much memory, MB.
    pub fn new(name: &'static str, limit_mb: usize) -> Self {
        Self {
            name,
            limit_bytes: limit_mb << 20,
            counts: Mutex::default(),
            _alone: ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner),
        }
    }

    /// Executes one input.
    pub fn run<E: Display>(&self, execute: impl FnOnce() -> Result<(), E>) {
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let result = execute();
        let peak_bytes = MEMORY.peak_usage().saturating_sub(before);
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        counts.executed += 1;
        counts.peak_bytes = counts.peak_bytes.max(peak_bytes);
        let limit_bytes = self.limit_bytes;
        assert!(
            peak_bytes <= limit_bytes,
            "{peak_bytes} bytes, more than {limit_bytes}"
        );
        if let Err(error) = result {
            counts.refused += 1;
            assert_sentence(&error);
        }
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        let counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        let (name, executed, refused) = (self.name, counts.executed, counts.refused);
        let peak_mb = counts.peak_bytes as f64 / 1e6;
        let _ = writeln!(
            std::io::stderr(),
            "{name}: {executed} inputs, {refused} refused, {peak_mb:.1} MB of memory at most"
        );
    }
}

/// Any error.
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
