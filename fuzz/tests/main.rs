//! The targets.

#![allow(clippy::unwrap_used)]

mod files;
mod messages;
mod recordings;
mod texts;
