//! Messages of ROS 2. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod cdr;
mod objects;
mod radar;
mod turn;
