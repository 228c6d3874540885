//! Recognition of drawn places.

mod descriptors;
mod files;
mod loops;
mod scenes;
