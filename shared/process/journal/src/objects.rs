//! The objects of each scan of a run, as the follower that tracks them has found them.

use gyre_contract::Object;
use gyre_slam::split;
use gyre_storage::{LogMagic, Record};

#[derive(Clone, Debug, PartialEq)]
pub struct LoggedObjects {
    /// The scan's number in the run, from 0 without gaps, which is its record's number.
    pub seq: u64,
    pub scan: u64,
    pub stamp_ns: i64,
    pub objects: Vec<Object>,
}

/// Little-endian: the fields in their order, then the objects.
impl Record for LoggedObjects {
    const FILE: &'static str = "objects.log";
    const MAGIC: LogMagic = *b"gyre objects 2 \n";

    fn encode(&self, bytes: &mut Vec<u8>) {
        let fixed = [self.seq, self.scan, self.stamp_ns.cast_unsigned()];
        bytes.extend_from_slice(bytemuck::bytes_of(&fixed));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.objects));
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let ([seq, scan, stamp_ns], objects) = split::<[u64; 3], Object>(bytes)?;
        Some(Self {
            seq,
            scan,
            stamp_ns: stamp_ns.cast_signed(),
            objects: objects.collect(),
        })
    }
}
