//! One record of `pairs.npy`: a scan as masking publishes it, and how it moved.

use half::f16;

/// A record, as in the table in [`super`].
pub struct Record<'a> {
    /// `n` x `n` cells, row 0 far ahead.
    pub raster: &'a [f16],
    /// Motion from the scan before, as searched: x and y (m), yaw (rad). NaN where a sequence begins.
    pub searched: [f64; 3],
    /// True pose: x and y (m), yaw (rad), in the truth's own frame.
    pub pose: [f64; 3],
    /// The scan's time, seconds since 1970.
    pub time_s: f64,
    /// The velocity of the motion compensation: m/s ahead and to the left, rad/s. Zero where it was not.
    pub twist: [f32; 3],
    /// Number of the sequence.
    pub sequence: u32,
}

impl Record<'_> {
    /// NumPy's description of a record with rasters of `n` x `n` cells, packed and little-endian.
    pub fn dtype(n: usize) -> String {
        format!(
            "[('raster', '<f2', ({n}, {n})), ('searched', '<f8', (3,)), ('pose', '<f8', (3,)), ('time_s', '<f8'), \
             ('twist', '<f4', (3,)), ('sequence', '<u4')]"
        )
    }

    /// Replaces what is in `out` by the record's bytes.
    pub fn encode(&self, out: &mut Vec<u8>) {
        out.clear();
        out.extend(self.raster.iter().flat_map(|cell| cell.to_le_bytes()));
        let [searched, pose] = [self.searched, self.pose];
        for value in searched.into_iter().chain(pose).chain([self.time_s]) {
            out.extend(value.to_le_bytes());
        }
        out.extend(self.twist.iter().flat_map(|value| value.to_le_bytes()));
        out.extend(self.sequence.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_its_fields_in_order() {
        let record = Record {
            raster: &[f16::ONE; 9],
            searched: [f64::NAN; 3],
            pose: [1.0, 2.0, 3.0],
            time_s: 4.0,
            twist: [5.0, 6.0, 7.0],
            sequence: 8,
        };
        let mut bytes = vec![0xff; 5];
        record.encode(&mut bytes);
        assert_eq!(bytes.len(), 9 * 2 + 7 * 8 + 3 * 4 + 4);
        assert_eq!(bytes[..2], [0x00, 0x3c]);
        assert_eq!(bytes[18 + 24..][..8], 1.0_f64.to_le_bytes());
        assert_eq!(bytes[18 + 48..][..8], 4.0_f64.to_le_bytes());
        assert_eq!(
            bytes[bytes.len() - 8..],
            [7.0_f32.to_le_bytes(), 8_u32.to_le_bytes()].concat()
        );
    }
}
