//! Operation: commands, services, swaps, load, and the machine that a run is on.

mod batch;
mod benchmark;
mod calibrate;
pub mod commands;
mod doctor;
mod evaluate;
mod front_door;
mod places;
mod resources;
mod scheduling;
mod stress;
mod swap;
mod systemd;
