//! Payload elements: blocks of 64 bytes, so that every payload starts on a cache line and is
//! aligned for any vector unit.
//!
//! The element type carries the alignment, because the transport multiplies the memory of an
//! aligned slice of bytes by the alignment.

use bytemuck::{Pod, Zeroable};

use crate::message::Element;

/// 64 bytes of a polar scan.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ByteBlock([u8; 64]);

/// 16 values of a raster.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct FloatBlock([f32; 16]);

/// Implements an element of as many values as `LEN`.
macro_rules! block {
    ($block:ty, $len:literal, $type_name:literal) => {
        impl $block {
            pub const LEN: usize = $len;

            pub fn count(values: usize) -> usize {
                values.div_ceil(Self::LEN)
            }
        }

        impl Element for $block {
            const TYPE_NAME: &'static str = $type_name;
        }

        const _: () = assert!(size_of::<$block>() == 64 && align_of::<$block>() == 64);
    };
}

block!(ByteBlock, 64, "gyre_byte_block_v1");
block!(FloatBlock, 16, "gyre_float_block_v1");
