//! The binary layout of a journal and of its records, and of records of other logs.

use bytemuck::{AnyBitPattern, pod_read_unaligned};
use gyre_contract::PoseHeader;
use gyre_storage::{Checksum, Slots};

/// The start of a journal, with the version of its records.
pub(crate) const MAGIC: [u8; 16] = *b"gyre journal v12";
/// The prefix of the start of a journal of any version.
pub(crate) const ANY_VERSION: &[u8] = b"gyre journal v";
const POSE: usize = size_of::<PoseHeader>();
/// Bytes of a record: the pose, the number of records before it that were in danger, and a checksum
/// of both.
pub(crate) const RECORD: usize = POSE + 8;
const CHECK: usize = POSE + 4;
/// The places of the records. So the offset of the one behind them is the length of a journal.
pub(crate) const RECORDS: Slots = Slots {
    start: MAGIC.len() as u64,
    bytes: RECORD,
};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Record {
    pub pose: PoseHeader,
    /// Number of records before it that were not known to be on the disk when it was written. All
    /// earlier ones were.
    pub in_danger: u32,
}

impl Record {
    pub fn encode(&self, bytes: &mut [u8; RECORD]) {
        bytes[..POSE].copy_from_slice(bytemuck::bytes_of(&self.pose));
        bytes[POSE..CHECK].copy_from_slice(&self.in_danger.to_le_bytes());
        Checksum::Last.seal(bytes);
    }

    /// Decodes the record number `index`. Records are numbered as their items are, so that one in a
    /// wrong place is not valid.
    pub fn decode(bytes: &[u8], index: u64) -> Option<Self> {
        let record = Self {
            pose: pod_read_unaligned(bytes.get(..POSE)?),
            in_danger: u32::from_le_bytes(*bytes[POSE..].first_chunk()?),
        };
        let is_valid = Checksum::Last.is_right(bytes) && record.pose.item.seq == index;
        is_valid.then_some(record)
    }
}

/// Splits a record into its part of fixed length and the items behind it; `None` if it ends within
/// one.
pub(crate) fn split<F: AnyBitPattern, T: AnyBitPattern>(
    bytes: &[u8],
) -> Option<(F, impl Iterator<Item = T> + '_)> {
    let (fixed, items) = bytes.split_at_checked(size_of::<F>())?;
    let items = items.chunks_exact(size_of::<T>());
    let is_whole = items.remainder().is_empty();
    is_whole.then(|| (pod_read_unaligned(fixed), items.map(pod_read_unaligned)))
}
