//! The content of records. Motions are in it bit for bit: a yaw would come back rounded, and a
//! resumed run would not repeat the run that was not stopped.

use bytemuck::{AnyBitPattern, Pod, Zeroable, pod_read_unaligned};
use gyre_geometry::{Pose, UncertainMotion, covariance};
use nalgebra::{Translation2, UnitComplex};

/// x and y (m), cosine and sine of the yaw, and the covariance.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub struct ExactMotion([f64; 4], covariance::Packed);

impl From<&UncertainMotion> for ExactMotion {
    fn from(motion: &UncertainMotion) -> Self {
        let (at, turn) = (motion.motion.translation, motion.motion.rotation);
        Self(
            [at.x, at.y, turn.re, turn.im],
            covariance::pack(&motion.covariance),
        )
    }
}

impl From<&ExactMotion> for UncertainMotion {
    fn from(ExactMotion([x, y, cos, sin], covariance): &ExactMotion) -> Self {
        let turn = UnitComplex::new_unchecked(nalgebra::Complex::new(*cos, *sin));
        Self {
            motion: Pose::from_parts(Translation2::new(*x, *y), turn),
            covariance: covariance::unpack(covariance),
        }
    }
}

/// Splits a record into its part of fixed length and the items behind it; `None` if it ends within
/// one.
pub fn split<F: AnyBitPattern, T: AnyBitPattern>(
    bytes: &[u8],
) -> Option<(F, impl Iterator<Item = T> + '_)> {
    let (fixed, items) = bytes.split_at_checked(size_of::<F>())?;
    let items = items.chunks_exact(size_of::<T>());
    let is_whole = items.remainder().is_empty();
    is_whole.then(|| (pod_read_unaligned(fixed), items.map(pod_read_unaligned)))
}
