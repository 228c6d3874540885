//! `masked`: Cartesian rasters with what would mislead the search taken out, and the scan's sparse points.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::SparsePoint;
use iceoryx2::prelude::ZeroCopySend;

use crate::{
    FloatBlock, Item,
    topic::{header, message},
};

message! {
    /// One raster where the mask depends on one scan alone; two (this scan, then the scan before, each as this
    /// pair's mask leaves it) where the mask looked at both. The second starts at the next whole block, and at the next
    /// after the last raster this scan's points.
    Masked, "masked", MaskedHeader, FloatBlock
}
header!(MaskedHeader);

/// Values of [`MaskedHeader::mask`].
pub mod mask_kind {
    /// No mask.
    pub const NONE: u32 = 0;
    /// Power below a threshold counts as nothing.
    pub const THRESHOLD: u32 = 1;
    /// Besides, a network weighed each cell.
    pub const LEARNED: u32 = 2;
}

/// A raster's geometry and how it was made.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_masked_header_v3")]
pub struct MaskedHeader {
    /// Which scan this is.
    pub item: Item,
    /// Cells a side. Row 0 is far ahead, column 0 far left, the sensor in the middle.
    pub n: u32,
    /// Rasters in the payload: 1 or 2.
    pub rasters: u32,
    /// Metres a cell.
    pub cell_m: f32,
    /// How it was masked: see [`mask_kind`].
    pub mask: u32,
    /// The velocity that the sweep's distortion was undone with: x, y (m/s), yaw (rad/s); zero where it was not.
    pub twist: [f32; 3],
    /// 1 where the sweep's distortion was undone.
    pub compensated: u32,
    /// Points behind the rasters, see [`MaskedHeader::points`].
    pub points: u32,
    /// Unused, zero.
    pub reserved: u32,
}

impl MaskedHeader {
    /// Values of one raster.
    pub fn cells(&self) -> usize {
        self.n as usize * self.n as usize
    }

    /// Values from one raster's start to that of what follows it, for rasters of so many cells.
    pub fn raster_values(cells: usize) -> usize {
        FloatBlock::count(cells) * FloatBlock::LEN
    }

    /// The scan's points. `None` where the payload is shorter than the header says.
    pub fn points<'a>(&self, values: &'a [f32]) -> Option<&'a [SparsePoint]> {
        let first = (self.rasters as usize).checked_mul(Self::raster_values(self.cells()))?;
        let (points, _) = values.get(first..)?.as_chunks::<5>();
        Some(bytemuck::cast_slice(points.get(..self.points as usize)?))
    }

    /// Room for points: as many as the values behind the rasters hold.
    pub fn points_mut(values: &mut [f32]) -> &mut [SparsePoint] {
        bytemuck::cast_slice_mut(values.as_chunks_mut::<5>().0)
    }

    /// The rasters to compare: this scan's, and that of the scan before, which is the second one here where the mask looked
    /// at both, else the first one there. `None` where a payload is shorter than its header says.
    pub fn pair<'a>(
        &self,
        values: &'a [f32],
        before: Option<(&Self, &'a [f32])>,
    ) -> Option<Pair<'a>> {
        let later = values.get(..self.cells())?;
        let second = Self::raster_values(self.cells());
        let earlier = match before {
            None => None,
            Some(_) if self.rasters == 2 => Some(values.get(second..second + self.cells())?),
            Some((header, values)) if header.n == self.n => Some(values.get(..self.cells())?),
            Some(_) => return None,
        };
        Some(Pair { later, earlier })
    }
}

/// Two rasters of the same size.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// This scan's.
    pub later: &'a [f32],
    /// That of the scan before; `None` where the chain of motions starts.
    pub earlier: Option<&'a [f32]>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_raster_before_comes_from_the_scan_before_unless_the_mask_looked_at_both() {
        let one = MaskedHeader {
            n: 3,
            rasters: 1,
            ..MaskedHeader::default()
        };
        let (now, then) = ([1.0; 32], [2.0; 32]);
        let earlier = |header: &MaskedHeader| {
            header
                .pair(&now, Some((&one, &then)))
                .and_then(|pair| pair.earlier)
        };
        assert_eq!(
            earlier(&one).map(|raster| (raster.len(), raster[0])),
            Some((9, 2.0))
        );
        let two = MaskedHeader { rasters: 2, ..one };
        assert_eq!(
            earlier(&two).map(|raster| (raster.len(), raster[0])),
            Some((9, 1.0))
        );
        assert!(
            one.pair(&now, None)
                .is_some_and(|pair| pair.earlier.is_none())
        );
        assert!(one.pair(&now[..8], None).is_none());
    }

    #[test]
    fn points_start_at_the_block_behind_the_last_raster() {
        let values: Vec<f32> = (0..48).map(|value| value as f32).collect();
        let one = MaskedHeader {
            n: 3,
            rasters: 1,
            points: 2,
            ..MaskedHeader::default()
        };
        let expected = [
            [16.0, 17.0, 18.0, 19.0, 20.0],
            [21.0, 22.0, 23.0, 24.0, 25.0],
        ]
        .map(SparsePoint::from);
        assert_eq!(one.points(&values), Some(expected.as_slice()));
        let two = MaskedHeader { rasters: 2, ..one };
        assert_eq!(two.points(&values).map(|points| points[0].x_m), Some(32.0));
        assert_eq!(MaskedHeader { points: 4, ..two }.points(&values), None);
        assert_eq!(
            MaskedHeader {
                rasters: u32::MAX,
                n: u32::MAX,
                ..one
            }
            .points(&values),
            None
        );
    }
}
