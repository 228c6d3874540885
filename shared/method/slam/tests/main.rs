//! Keyframes, loops and the corrected trajectory. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod common;
mod estimation;
mod maps;

mod closing;
mod fixes;
mod street;
mod trajectory;
