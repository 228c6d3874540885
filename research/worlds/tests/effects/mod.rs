//! Quantitative tests of each effect of the sensor, on and off.

mod beam;
mod chance;
mod documentation;
mod echoes;
mod ground;
mod highlights;
mod motion;
mod noise;
mod road;
pub mod scene;
mod scintillation;
mod weather;
