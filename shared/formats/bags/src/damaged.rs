//! Reads MCAP files that may be damaged or cut, record by record.
//!
//! The reader of the `mcap` crate takes the lengths that a damaged file states for what they are,
//! and allocates them. Here nothing is larger than the bytes that are there, or than a limit where
//! they are compressed, and no damage is a panic.

mod parse;
mod records;
mod walk;

pub use parse::parse;
pub use records::records;
pub use walk::{Damage, Span, Walk, read, sentence};
