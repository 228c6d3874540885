//! The terminal: what a program of Gyre says to the person there, and how it ends.

mod command;
mod failure;
pub mod print;
mod program;
mod wrap;

pub use command::{own, seconds, words};
pub use failure::Failure;
pub use program::{INTERRUPTED, parse, parse_as, report};
pub use wrap::{WIDTH, wrap};
