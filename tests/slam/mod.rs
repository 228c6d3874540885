//! SLAM: keyframes, loops, maps, and localisation in them.

mod extended_maps;
mod followers;
pub mod gnss;
mod keyframes;
mod localise;
mod loops;
