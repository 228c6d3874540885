//! Odometry of whole drives. One program, so that all of it is linked once.

mod covariances;
mod examples;
mod heading;
mod sample_faults;
mod standing_pair;
