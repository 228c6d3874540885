use bytemuck::{Pod, Zeroable};
use gyre_geometry::UncertainMotion;
use gyre_storage::{LogMagic, Record};

use crate::{estimation::places::Descriptor, exact::ExactMotion};

/// All that later queries need of a keyframe beside its points.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    pub path_m: f64,
    /// The motion from the keyframe before, as [`Keyframe::motion`](crate::Keyframe::motion).
    pub motion: UncertainMotion,
    pub descriptor: Descriptor,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Fixed {
    path_m: f64,
    motion: ExactMotion,
}

/// Little-endian: path, motion, descriptor.
impl Record for Place {
    const FILE: &'static str = "places.log";
    const MAGIC: LogMagic = *b"gyre places 1\n\0\0";

    fn encode(&self, bytes: &mut Vec<u8>) {
        let fixed = Fixed {
            path_m: self.path_m,
            motion: ExactMotion::from(&self.motion),
        };
        bytes.extend_from_slice(bytemuck::bytes_of(&fixed));
        self.descriptor.encode(bytes);
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (fixed, descriptor) = bytes.split_at_checked(size_of::<Fixed>())?;
        let fixed: Fixed = bytemuck::pod_read_unaligned(fixed);
        Some(Self {
            path_m: fixed.path_m,
            motion: UncertainMotion::from(&fixed.motion),
            descriptor: Descriptor::decode(descriptor)?,
        })
    }
}
