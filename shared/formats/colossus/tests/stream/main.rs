//! A radar's stream: written, cut into pieces, damaged, parsed, stamped, assembled.

#![allow(clippy::unwrap_used)]

mod clocks;
mod messages;
mod support;
mod sweeps;
