//! Trajectories, graphs and places as their users call them. One program, so that all of it is
//! linked once.

pub mod common;

mod consistency;
mod filter;
mod g2o;
mod graph;
mod places;
mod positions;
mod wrong_loops;
