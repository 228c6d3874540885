//! The terminal: a program's messages to the person there, and its end.

mod command;
mod failure;
pub mod inputs;
pub mod print;
mod program;
mod wrap;

pub use command::{execute_again, own, seconds, words};
pub use failure::Failure;
pub use program::{INTERRUPTED, parse, parse_as, report};
pub use wrap::{WIDTH, wrap};
