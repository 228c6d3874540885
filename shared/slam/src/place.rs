//! The place of a keyframe, and its form in a file.

use bytemuck::{Pod, Zeroable};
use gyre_estimation::places::Descriptor;
use gyre_geometry::UncertainMotion;
use thiserror::Error;

use crate::exact::ExactMotion;

/// All that later queries need of a keyframe beside its points.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Path through all keyframes up to this one, m.
    pub path_m: f64,
    /// The motion from the keyframe before, as [`Keyframe::motion`](crate::Keyframe::motion).
    pub motion: UncertainMotion,
    /// The descriptor of the submap around the keyframe.
    pub descriptor: Descriptor,
}

/// Bytes that are not a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{0} bytes are not a place")]
pub struct MalformedPlace(usize);

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Fixed {
    path_m: f64,
    motion: ExactMotion,
}

impl Place {
    /// Appends the form in a file, little-endian: path, motion, descriptor.
    pub fn encode(&self, bytes: &mut Vec<u8>) {
        let fixed = Fixed {
            path_m: self.path_m,
            motion: ExactMotion::from(&self.motion),
        };
        bytes.extend_from_slice(bytemuck::bytes_of(&fixed));
        self.descriptor.encode(bytes);
    }

    /// Decodes what [`encode`](Self::encode) has written.
    ///
    /// # Errors
    /// A length that none has.
    pub fn decode(bytes: &[u8]) -> Result<Self, MalformedPlace> {
        let malformed = MalformedPlace(bytes.len());
        let (fixed, descriptor) = bytes
            .split_at_checked(size_of::<Fixed>())
            .ok_or(malformed)?;
        let fixed: Fixed = bytemuck::pod_read_unaligned(fixed);
        Ok(Self {
            path_m: fixed.path_m,
            motion: UncertainMotion::from(&fixed.motion),
            descriptor: Descriptor::decode(descriptor).ok_or(malformed)?,
        })
    }
}
