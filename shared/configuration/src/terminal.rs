//! The terminal: a program's messages to the person there, and its end.

mod command;
pub mod inputs;
pub mod print;
mod program;
mod wrap;

pub use command::{execute_again, own, seconds, words};
pub use program::{INTERRUPTED, parse, parse_as, report};
pub use wrap::{WIDTH, wrap};

/// A sentence for the person at the terminal: why a command has failed.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;
