//! The loops over bins and cells, compiled for the vector units that the processor turns out to have.
//!
//! They are plain Rust without fused multiply-add, so every variant gives the same bits.
//! `multiversion` calls the variant that it chose through a function pointer; those calls are the only unsafe code.
#![allow(unsafe_code)]

pub(super) mod locate;
pub(super) mod window;
