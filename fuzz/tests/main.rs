//! The targets.

#![allow(clippy::unwrap_used)]

mod bags;
mod files;
mod messages;
mod recordings;
mod runs;
mod streams;
mod texts;
