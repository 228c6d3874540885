//! The points of a scan.

use bytemuck::{Pod, Zeroable};

/// One return of a scan as measured, without compensation of motion or of the Doppler shift.
///
/// With `u` the direction to the point and `v` the velocity of the sensor, the true position is
/// `(x, y) + doppler_s (u . v) u` in the sensor's frame at the time of its azimuth.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SparsePoint {
    /// Forward of the sensor at the time of the point's azimuth, m.
    pub x_m: f32,
    /// To the left of it, m.
    pub y_m: f32,
    /// Time of the azimuth relative to the scan's stamp, s.
    pub time_s: f32,
    /// Weight from 0 to 1. A weight that is not above 0 counts as 0.
    pub weight: f32,
    /// Metres to add to the range for each m/s at which the sensor approaches the point; 0 if unknown.
    pub doppler_s: f32,
}

/// A point from its fields in their order.
impl From<[f32; 5]> for SparsePoint {
    fn from(fields: [f32; 5]) -> Self {
        bytemuck::cast(fields)
    }
}

/// The fields of a point in their order.
impl From<SparsePoint> for [f32; 5] {
    fn from(point: SparsePoint) -> Self {
        bytemuck::cast(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_five_packed_floats() {
        assert_eq!(
            (size_of::<SparsePoint>(), align_of::<SparsePoint>()),
            (20, 4)
        );
    }
}
