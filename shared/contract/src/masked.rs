//! `masked`: masked Cartesian rasters and the scan's sparse points.

use gyre_geometry::{
    SparsePoint, Twist,
    samples::{Evidence, Witness},
};
use ndarray::{ArrayView2, ArrayViewMut2};

use crate::{
    item::Item,
    limits::Limits,
    message::{ByteBlock, FloatBlock, Header},
    wire::{Bounds, codes, describe, wire},
};

codes! {
    /// Values of [`MaskedHeader::mask`].
    pub mod mask_kind: u32 {
        NONE = "none",
        /// Power up to a threshold is set to zero.
        THRESHOLD = "threshold",
        /// A network weights each cell above the threshold.
        LEARNED = "learned",
    }
}

wire! {
    /// The geometry of a raster and the processing that led to it.
    pub struct MaskedHeader = "gyre_masked_header_v10" {
        pub item: Item,
        /// Cells per side. Row 0 is far ahead, column 0 far left, the sensor is in the middle.
        pub n: u32 [Bounds::OfRun(|it| it.side() as f64)],
        /// Rasters in the payload: 1 or 2.
        pub rasters: u32 [Bounds::OfRun(|it| it.rasters as f64)],
        pub cell_m: f32 [Bounds::OfRun(|it| it.cell_m.into())],
        /// See [`mask_kind`].
        pub mask: u32 [Bounds::Codes(mask_kind::NAMES)],
        /// The velocity used for motion compensation: x, y (m/s), yaw rate (rad/s); zero without
        /// compensation.
        pub twist: [f32; 3] [Bounds::Finite],
        /// 1 if the scan is motion-compensated.
        pub compensated: u32,
        /// Number of points after the rasters.
        pub points: u32 [Bounds::AtMost(|it| it.points as f64)],
        /// Variance of the mean of the rows' azimuths, rad²: not zero where azimuths were lost at
        /// places that are not known.
        pub azimuth_variance_rad2: f32 [Bounds::NotNegative],
        /// About the motion from the previous scan, in the order of [`Witness::ALL`].
        pub evidence: [Evidence; Witness::ALL.len()],
    }
}

describe! {
    /// A measurement by another sensor than the radar about the motion from the scan before to a
    /// scan. Of a gyro: the turn from stamp to stamp (rad), counter-clockwise, and the mean rate
    /// during the sweep (rad/s), both with the bias. Of wheels: the distance ahead along the
    /// vehicle's path (m). Of Doppler: the velocity of the radar in the middle of the sweep, ahead
    /// and to the left (m/s). Of an absolute heading: the heading at the stamp (rad).
    Evidence = "gyre_evidence_v1" {
        /// Number of samples or bearings that determine it; zero: it was not measured.
        samples: u64,
        /// From the stamp of the scan before to the stamp of the scan, s; zero of a velocity and
        /// of a heading.
        interval_s: f64 [Bounds::NotNegative],
        value: [f64; 2] [Bounds::Finite],
        /// Variance of the first value, covariance, variance of the second, but for the errors that
        /// all motions share: bias and scale.
        covariance: [f64; 3] [Bounds::Covariance2],
    }
}

/// The parts of a payload, to fill in: see [`MaskedHeader::split`].
#[derive(Debug)]
pub struct MaskedParts<'a> {
    pub later: ArrayViewMut2<'a, f32>,
    /// The raster of the previous scan, n x n, if the mask takes two scans.
    pub earlier: Option<ArrayViewMut2<'a, f32>>,
    pub points: &'a mut [SparsePoint],
}

/// Two rasters to match, n x n each.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    pub later: ArrayView2<'a, f32>,
    /// The raster of the previous scan; `None` where the chain of motions starts.
    pub earlier: Option<ArrayView2<'a, f32>>,
    /// True if the mask took both scans: the earlier raster then differs from the later one of the
    /// previous pair.
    pub earlier_changed: bool,
}

impl Header for MaskedHeader {
    /// Checks the length of the payload, and that the points are finite. The rasters are not looked
    /// at.
    fn check_content(&self, payload: &[u8], _: &Limits) -> Result<(), String> {
        let points = self.points(bytemuck::cast_slice(payload)).ok_or_else(|| {
            let (bytes, n, rasters) = (payload.len(), self.n, self.rasters);
            format!(
                "its payload of {bytes} bytes is shorter than its header states: {rasters} rasters of {n} x {n} cells and {} points",
                self.points
            )
        })?;
        let is_finite =
            |point: &SparsePoint| <[f32; 5]>::from(*point).iter().all(|it| it.is_finite());
        match points.iter().position(|point| !is_finite(point)) {
            None => Ok(()),
            Some(index) => Err(format!(
                "point {index} is {:?}, but must be finite",
                points[index]
            )),
        }
    }

    fn max_elements(limits: &Limits) -> usize {
        limits.rasters * FloatBlock::count(limits.raster_cells)
            + (limits.points * size_of::<SparsePoint>()).div_ceil(ByteBlock::LEN)
    }

    fn content_bytes(&self) -> Option<usize> {
        let points = (self.points as usize).checked_mul(size_of::<SparsePoint>())?;
        let rasters = self.first_point()?.checked_mul(size_of::<f32>())?;
        rasters.checked_add(points)
    }

    fn words(&self, _: &[u8]) -> String {
        let (n, cell_m, rasters, points) = (self.n, self.cell_m, self.rasters, self.points);
        let s = if rasters == 1 { "" } else { "s" };
        format!("{rasters} raster{s} of {n} x {n} cells of {cell_m} m, {points} points")
    }
}

impl MaskedHeader {
    /// Returns the number of values of one raster, rounded up to whole blocks.
    fn raster_values(n: usize) -> Option<usize> {
        let cells = n.checked_mul(n)?;
        Some(FloatBlock::count(cells) * FloatBlock::LEN)
    }

    /// Returns the evidence of a kind; `None` if nothing was measured.
    pub fn of(&self, kind: Witness) -> Option<&Evidence> {
        self.evidence[kind as usize].measured()
    }

    /// Returns the turn since the scan before by the gyro, rad, which limits a search for it;
    /// `None` if it was not measured.
    pub fn turn_rad(&self) -> Option<f64> {
        self.of(Witness::Gyro).map(|turn| turn.value[0])
    }

    /// Splits a payload into its parts, with `rasters` (1 or 2) of n x n cells. `None` if it is too
    /// short.
    pub fn split<'a>(values: &'a mut [f32], n: usize, rasters: usize) -> Option<MaskedParts<'a>> {
        let raster = Self::raster_values(n)?;
        let (later, rest) = values.split_at_mut_checked(raster)?;
        let (earlier, rest) = match rasters {
            2 => {
                let (earlier, rest) = rest.split_at_mut_checked(raster)?;
                (Some(earlier), rest)
            }
            _ => (None, rest),
        };
        let view =
            |values: &'a mut [f32]| ArrayViewMut2::from_shape((n, n), &mut values[..n * n]).ok();
        let floats = size_of::<SparsePoint>() / size_of::<f32>();
        let whole = rest.len() / floats * floats;
        Some(MaskedParts {
            later: view(later)?,
            earlier: earlier.and_then(view),
            points: bytemuck::cast_slice_mut(&mut rest[..whole]),
        })
    }

    /// Returns raster `index` of a payload, n x n; `None` if the payload is too short for its
    /// header.
    fn raster<'a>(&self, values: &'a [f32], index: usize) -> Option<ArrayView2<'a, f32>> {
        let n = self.n as usize;
        let first = index.checked_mul(Self::raster_values(n)?)?;
        let cells = values.get(first..first.checked_add(n * n)?)?;
        ArrayView2::from_shape((n, n), cells).ok()
    }

    fn first_point(&self) -> Option<usize> {
        (self.rasters as usize).checked_mul(Self::raster_values(self.n as usize)?)
    }

    /// Returns the scan's points; `None` if the payload is too short for its header.
    pub fn points<'a>(&self, values: &'a [f32]) -> Option<&'a [SparsePoint]> {
        let first = self.first_point()?;
        let floats = size_of::<SparsePoint>() / size_of::<f32>();
        let count = (self.points as usize).checked_mul(floats)?;
        Some(bytemuck::cast_slice(values.get(first..)?.get(..count)?))
    }

    /// Returns where points of this scan lie in its frame (x, y in m), motion-compensated as its
    /// raster is, and the weight of each. Those without weight are left out.
    pub fn deskewed<'a>(
        &self,
        points: &'a [SparsePoint],
    ) -> impl Iterator<Item = ([f64; 2], f32)> + use<'a> {
        let [vx_mps, vy_mps, yaw_rate_radps] = self.twist.map(f64::from);
        let twist = Twist {
            vx_mps,
            vy_mps,
            yaw_rate_radps,
        };
        let seen = points.iter().filter(|point| point.weight > 0.0);
        seen.map(move |point| (point.deskewed(&twist).into(), point.weight))
    }

    /// Returns the rasters to match. The earlier one is the second raster of this payload if the
    /// mask took both scans, else the first raster of the previous message. `None` if a payload is
    /// too short for its header.
    pub fn pair<'a>(
        &self,
        values: &'a [f32],
        previous: Option<(&Self, &'a [f32])>,
    ) -> Option<Pair<'a>> {
        let earlier_changed = self.rasters == 2;
        let earlier = match previous {
            None => None,
            Some(_) if earlier_changed => Some(self.raster(values, 1)?),
            Some((header, values)) if header.n == self.n => Some(header.raster(values, 0)?),
            Some(_) => return None,
        };
        Some(Pair {
            later: self.raster(values, 0)?,
            earlier,
            earlier_changed,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earlier_raster_is_of_the_previous_message_unless_the_mask_took_both_scans() {
        let one = MaskedHeader {
            n: 3,
            rasters: 1,
            ..MaskedHeader::default()
        };
        let (now, then) = ([1.0; 32], [2.0; 32]);
        let earlier = |header: &MaskedHeader| {
            let pair = header.pair(&now, Some((&one, &then)))?;
            pair.earlier.map(|raster| (raster.dim(), raster[[0, 0]]))
        };
        assert_eq!(earlier(&one), Some(((3, 3), 2.0)));
        let two = MaskedHeader { rasters: 2, ..one };
        assert_eq!(earlier(&two), Some(((3, 3), 1.0)));
        assert!(
            one.pair(&now, None)
                .is_some_and(|pair| pair.earlier.is_none())
        );
        assert!(one.pair(&now[..8], None).is_none());
    }

    #[test]
    fn parts_that_were_written_are_read_back() {
        for rasters in [1, 2] {
            let mut values = vec![0.0_f32; (rasters + 1) * 16];
            let mut parts = MaskedHeader::split(&mut values, 3, rasters).unwrap();
            assert_eq!(parts.points.len(), 3);
            parts.later.fill(1.0);
            parts.earlier.iter_mut().for_each(|raster| raster.fill(2.0));
            parts.points[1].weight = 0.5;
            let header = MaskedHeader {
                n: 3,
                rasters: rasters as u32,
                points: 2,
                ..MaskedHeader::default()
            };
            let pair = header.pair(&values, Some((&header, &values))).unwrap();
            assert_eq!(pair.later.sum(), 9.0);
            assert_eq!(pair.earlier.unwrap().sum(), 9.0 * rasters as f32);
            assert_eq!(header.points(&values).unwrap()[1].weight, 0.5);
            assert_eq!(
                MaskedHeader {
                    points: 4,
                    ..header
                }
                .points(&values),
                None
            );
        }
        assert!(MaskedHeader::split(&mut [0.0; 16], 3, 2).is_none());
        let absurd = MaskedHeader {
            rasters: u32::MAX,
            n: u32::MAX,
            ..MaskedHeader::default()
        };
        assert_eq!(absurd.points(&[0.0; 16]), None);
        assert!(absurd.pair(&[0.0; 16], None).is_none());
    }
}
