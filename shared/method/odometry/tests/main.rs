//! Odometry of whole drives. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod covariances;
mod doppler;
mod examples;
mod lost_azimuths;
mod sample_faults;
mod standing_pair;
mod stop_and_go;
