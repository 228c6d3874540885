//! The loops over bins and cells, compiled for each vector unit. They are plain Rust without fused
//! multiply-add, so every variant gives the same bits.

pub(super) mod locate;
pub(super) mod window;
