//! Recognition of drawn and of simulated places.

mod descriptors;
mod files;
mod loops;
mod scenes;
mod simulated_street;
