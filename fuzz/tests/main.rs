//! The targets.

#![allow(clippy::unwrap_used)]

mod files;
mod keyframes;
mod messages;
mod recordings;
mod simulations;
mod streams;
mod texts;
