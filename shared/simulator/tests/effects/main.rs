//! Each of the sensor's effects does what it says, in numbers; and without it nothing of it is left.
#![allow(clippy::unwrap_used)]

mod beam;
mod chance;
mod documentation;
mod echoes;
mod ground;
mod highlights;
mod motion;
mod noise;
mod scene;
mod scintillation;
mod weather;
