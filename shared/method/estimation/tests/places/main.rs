//! Recognition of drawn and of simulated places.
#![allow(clippy::unwrap_used)]

mod descriptors;
mod files;
mod loops;
mod scenes;
mod simulated_street;
