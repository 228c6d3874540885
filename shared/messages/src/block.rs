//! Payload elements: blocks of 64 bytes, so that every payload starts on a cache line and fits any vector register.
//!
//! The alignment belongs to the element: asking the transport to align a slice of bytes multiplies the memory by the alignment.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// 64 bytes of an image.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ByteBlock([u8; 64]);

/// 16 values of a raster.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct FloatBlock([f32; 16]);

impl ByteBlock {
    /// Bytes a block.
    pub const LEN: usize = 64;

    /// Blocks that hold this many bytes.
    pub fn count(bytes: usize) -> usize {
        bytes.div_ceil(Self::LEN)
    }
}

impl FloatBlock {
    /// Values a block.
    pub const LEN: usize = 16;

    /// Blocks that hold this many values.
    pub fn count(values: usize) -> usize {
        values.div_ceil(Self::LEN)
    }
}

// SAFETY: plain numbers, repr(C), no pointers. By hand, because the derive refuses `align`.
unsafe impl ZeroCopySend for ByteBlock {
    unsafe fn type_name() -> &'static str {
        "gyre_byte_block_v1"
    }
}

// SAFETY: as above.
unsafe impl ZeroCopySend for FloatBlock {
    unsafe fn type_name() -> &'static str {
        "gyre_float_block_v1"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_one_cache_line() {
        assert_eq!((size_of::<ByteBlock>(), align_of::<ByteBlock>()), (64, 64));
        assert_eq!(
            (size_of::<FloatBlock>(), align_of::<FloatBlock>()),
            (64, 64)
        );
        assert_eq!((ByteBlock::count(64), ByteBlock::count(65)), (1, 2));
    }
}
