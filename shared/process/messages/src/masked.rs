//! `masked`: masked Cartesian rasters and the scan's sparse points.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{SparsePoint, Twist};
use gyre_samples::{DopplerVelocity, GyroTurn, WheelDistance};
use ndarray::{ArrayView2, ArrayViewMut2};

use crate::{
    check::{code, fields, finite, not_negative, of, require},
    item::{Item, StageId},
    limits::{History, Limits, TopicSizes, Window},
    message::{ByteBlock, FloatBlock, Message, Sender, header},
};

/// The payload is one raster if the mask takes one scan, or two (this scan and the previous one,
/// both masked for this pair) if it takes both; then the scan's points. Each part starts at a whole
/// block.
#[derive(Debug)]
pub enum Masked {}

impl Message for Masked {
    const TOPIC: &'static str = "masked";
    const SENDER: Sender = Sender::Stage(&[StageId::Masking]);
    // Rotation search, translation search and refinement.
    const READERS: usize = 3;
    const HISTORY: History = History::Stream;
    type Header = MaskedHeader;
    type Element = FloatBlock;

    fn content_bytes(header: &Self::Header) -> Option<usize> {
        let points = (header.points as usize).checked_mul(size_of::<SparsePoint>())?;
        let rasters = header.first_point()?.checked_mul(size_of::<f32>())?;
        rasters.checked_add(points)
    }

    /// In a run with SLAM pose-integration reads the points of keyframes.
    fn sizes(window: &Window) -> TopicSizes {
        window.queues(
            Self::HISTORY,
            Self::READERS + usize::from(window.logs_points()),
        )
    }

    fn max_elements(limits: &Limits) -> usize {
        limits.rasters * FloatBlock::count(limits.raster_cells)
            + (limits.points * size_of::<SparsePoint>()).div_ceil(ByteBlock::LEN)
    }
}
header!(MaskedHeader, "gyre_masked_header_v9");

/// Values of [`MaskedHeader::mask`].
pub mod mask_kind {
    pub const NONE: u32 = 0;
    /// Power up to a threshold is set to zero.
    pub const THRESHOLD: u32 = 1;
    /// A network weights each cell above the threshold.
    pub const LEARNED: u32 = 2;
}

/// The geometry of a raster and the processing that led to it. What `has_*` is 1 for was measured:
/// the turn and the distance since the previous scan, and the velocity during this one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct MaskedHeader {
    pub item: Item,
    /// Cells per side. Row 0 is far ahead, column 0 far left, the sensor is in the middle.
    pub n: u32,
    /// Rasters in the payload: 1 or 2.
    pub rasters: u32,
    pub cell_m: f32,
    /// See [`mask_kind`].
    pub mask: u32,
    /// The velocity used for motion compensation: x, y (m/s), yaw rate (rad/s); zero without
    /// compensation.
    pub twist: [f32; 3],
    /// 1 if the scan is motion-compensated.
    pub compensated: u32,
    /// Number of points after the rasters.
    pub points: u32,
    /// Variance of the mean of the rows' azimuths, rad²: not zero where azimuths were lost at
    /// places that are not known.
    pub azimuth_variance_rad2: f32,
    pub gyro: GyroTurn,
    pub has_gyro: u64,
    pub wheels: WheelDistance,
    pub has_wheels: u64,
    pub doppler: DopplerVelocity,
    pub has_doppler: u64,
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

impl MaskedHeader {
    /// Checks the sizes, the length of the payload, and that the points are finite. The rasters are
    /// not looked at.
    fn check_content(&self, payload: &[u8], limits: &Limits) -> Result<(), String> {
        let values: &[f32] = bytemuck::cast_slice(payload);
        let (n, rasters, points) = (self.n as usize, self.rasters as usize, self.points as usize);
        require(n == limits.side(), "n", n, limits.side())?;
        let fits = rasters == limits.rasters;
        require(fits, "rasters", rasters, limits.rasters)?;
        let fits = self.cell_m == limits.cell_m;
        require(fits, "cell_m", self.cell_m, limits.cell_m)?;
        let most = limits.points;
        require(
            points <= most,
            "points",
            points,
            format_args!("at most {most}"),
        )?;
        code("mask", self.mask, mask_kind::LEARNED)?;
        let [vx, vy, yaw_rate] = self.twist.map(f64::from);
        finite([("twist[0]", vx), ("twist[1]", vy), ("twist[2]", yaw_rate)])?;
        not_negative([("azimuth_variance_rad2", self.azimuth_variance_rad2.into())])?;
        self.check_measured()?;
        let points = self.points(values).ok_or_else(|| {
            let bytes = payload.len();
            format!("its payload of {bytes} bytes is shorter than its header states: {rasters} rasters of {n} x {n} cells and {points} points")
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

    /// Checks the turn, the distance and the velocity.
    fn check_measured(&self) -> Result<(), String> {
        code("has_gyro", self.has_gyro, 1_u64)?;
        code("has_wheels", self.has_wheels, 1_u64)?;
        code("has_doppler", self.has_doppler, 1_u64)?;
        let (gyro, wheels) = (&self.gyro, &self.wheels);
        of("gyro.", finite(fields![gyro; yaw_rad sweep_rate_radps]))?;
        let spread = fields![gyro; variance_rad2 interval_s];
        of("gyro.", not_negative(spread))?;
        of("wheels.", finite(fields![wheels; distance_m]))?;
        let spread = fields![wheels; variance_m2 side_variance_m2 interval_s];
        of("wheels.", not_negative(spread))?;
        let ([vx, vy], [xx, xy, yy]) = (self.doppler.velocity_mps, self.doppler.covariance);
        let velocity = [("velocity_mps[0]", vx), ("velocity_mps[1]", vy)];
        of("doppler.", finite(velocity))?;
        of("doppler.", finite([("covariance[1]", xy)]))?;
        let spread = [("covariance[0]", xx), ("covariance[2]", yy)];
        of("doppler.", not_negative(spread))
    }

    /// Returns the number of values of one raster, rounded up to whole blocks.
    fn raster_values(n: usize) -> Option<usize> {
        let cells = n.checked_mul(n)?;
        Some(FloatBlock::count(cells) * FloatBlock::LEN)
    }

    pub fn turn(&self) -> Option<GyroTurn> {
        (self.has_gyro == 1).then_some(self.gyro)
    }

    pub fn distance(&self) -> Option<WheelDistance> {
        (self.has_wheels == 1).then_some(self.wheels)
    }

    pub fn velocity(&self) -> Option<DopplerVelocity> {
        (self.has_doppler == 1).then_some(self.doppler)
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
    #![allow(clippy::unwrap_used)]
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
