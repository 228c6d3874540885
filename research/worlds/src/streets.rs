//! The streets of a town: centre lines with a width, and how far from them a place is.

mod along;
mod lines;
mod merge;
mod network;
mod side;
mod street;

pub use network::{Nearest, Streets};
pub use street::Street;
