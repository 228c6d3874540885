//! Recognition of drawn places.

mod descriptors;
mod files;
mod loops;
pub mod scenes;
