//! The targets.

#![allow(clippy::unwrap_used)]

mod bags;
mod files;
mod keyframes;
mod messages;
mod recordings;
mod runs;
mod simulations;
mod streams;
mod texts;
