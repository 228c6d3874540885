//! Motions in files, bit for bit: a yaw would come back rounded, and a resumed run would not repeat
//! the run that was not stopped.

use bytemuck::{Pod, Zeroable};
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
