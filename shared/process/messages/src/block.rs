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

impl ByteBlock {
    /// Bytes per block.
    pub const LEN: usize = 64;

    /// Returns the number of blocks that hold this many bytes.
    pub fn count(bytes: usize) -> usize {
        bytes.div_ceil(Self::LEN)
    }
}

impl FloatBlock {
    /// Values per block.
    pub const LEN: usize = 16;

    /// Returns the number of blocks that hold this many values.
    pub fn count(values: usize) -> usize {
        values.div_ceil(Self::LEN)
    }
}

impl Element for ByteBlock {
    const TYPE_NAME: &'static str = "gyre_byte_block_v1";
}

impl Element for FloatBlock {
    const TYPE_NAME: &'static str = "gyre_float_block_v1";
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
