//! Learned masks. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod common;

mod learned;
mod rejected;
mod shipped;
