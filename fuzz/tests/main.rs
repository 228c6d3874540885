//! The targets.

#![allow(clippy::unwrap_used)]

mod bags;
mod files;
mod keyframes;
mod messages;
mod recordings;
mod simulations;
mod streams;
mod texts;
