//! Recognition of drawn and of simulated places.

mod descriptors;
mod files;
mod loops;
pub mod scenes;
mod simulated_street;
