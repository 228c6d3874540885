//! `masked`: masked Cartesian rasters and the scan's sparse points.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{SparsePoint, Twist};
use gyre_samples::{DopplerVelocity, GyroTurn, WheelDistance};
use ndarray::{ArrayView2, ArrayViewMut2};

use crate::{
    block::{ByteBlock, FloatBlock},
    check::{Violation, finite, require},
    item::{Item, StageId},
    limits::{History, Limits, TopicSizes, Window},
    message::{Message, Sender, header},
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

    fn check_content(
        header: &Self::Header,
        payload: &[Self::Element],
        limits: &Limits,
    ) -> Result<(), Violation> {
        header.check(bytemuck::cast_slice(payload), limits)
    }

    /// The rasters, and the points after them.
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

/// The geometry of a raster and the processing that led to it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct MaskedHeader {
    pub item: Item,
    /// Cells per side. Row 0 is far ahead, column 0 far left, the sensor is in the middle.
    pub n: u32,
    /// Rasters in the payload: 1 or 2.
    pub rasters: u32,
    /// Size of a cell, m.
    pub cell_m: f32,
    /// The mask: see [`mask_kind`].
    pub mask: u32,
    /// The velocity used for motion compensation: x, y (m/s), yaw rate (rad/s); zero without
    /// compensation.
    pub twist: [f32; 3],
    /// 1 if the scan is motion-compensated.
    pub compensated: u32,
    /// Number of points after the rasters: see [`MaskedHeader::points`].
    pub points: u32,
    /// Variance of the mean of the rows' azimuths, rad²: not zero where azimuths were lost at
    /// places that are not known.
    pub azimuth_variance_rad2: f32,
    /// The turn since the previous scan by the gyro: see [`MaskedHeader::turn`].
    pub gyro: GyroTurn,
    /// 1 if the gyro measured the turn.
    pub has_gyro: u64,
    /// The distance since the previous scan by the wheels: see [`MaskedHeader::distance`].
    pub wheels: WheelDistance,
    /// 1 if the wheels measured the distance.
    pub has_wheels: u64,
    /// The velocity by Doppler during this scan: see [`MaskedHeader::velocity`].
    pub doppler: DopplerVelocity,
    /// 1 if the scan determines the velocity.
    pub has_doppler: u64,
}

/// The parts of a payload, to fill in: see [`MaskedHeader::split`].
#[derive(Debug)]
pub struct MaskedParts<'a> {
    /// The raster of this scan, n x n.
    pub later: ArrayViewMut2<'a, f32>,
    /// The raster of the previous scan, n x n, if the mask takes two scans.
    pub earlier: Option<ArrayViewMut2<'a, f32>>,
    /// The scan's points.
    pub points: &'a mut [SparsePoint],
}

/// Two rasters to match, n x n each.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// The raster of this scan.
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
    fn check(&self, values: &[f32], limits: &Limits) -> Result<(), Violation> {
        let (n, rasters, points) = (self.n as usize, self.rasters as usize, self.points as usize);
        require(n == limits.side(), "n", n, limits.side())?;
        require(
            rasters == limits.rasters,
            "rasters",
            rasters,
            limits.rasters,
        )?;
        require(
            self.cell_m == limits.cell_m,
            "cell_m",
            self.cell_m,
            limits.cell_m,
        )?;
        require(
            points <= limits.points,
            "points",
            points,
            format_args!("at most {}", limits.points),
        )?;
        require(self.mask <= mask_kind::LEARNED, "mask", self.mask, "0 to 2")?;
        let [vx, vy, yaw_rate] = self.twist.map(f64::from);
        finite([("twist[0]", vx), ("twist[1]", vy), ("twist[2]", yaw_rate)])?;
        require(
            self.azimuth_variance_rad2 >= 0.0 && self.azimuth_variance_rad2.is_finite(),
            "azimuth_variance_rad2",
            self.azimuth_variance_rad2,
            "finite, 0 or more",
        )?;
        require(self.has_gyro <= 1, "has_gyro", self.has_gyro, "0 or 1")?;
        require(
            self.has_wheels <= 1,
            "has_wheels",
            self.has_wheels,
            "0 or 1",
        )?;
        let has_doppler = self.has_doppler;
        require(has_doppler <= 1, "has_doppler", has_doppler, "0 or 1")?;
        let (gyro, wheels, doppler) = (&self.gyro, &self.wheels, &self.doppler);
        finite([
            ("doppler.velocity_mps[0]", doppler.velocity_mps[0]),
            ("doppler.velocity_mps[1]", doppler.velocity_mps[1]),
            ("doppler.covariance[1]", doppler.covariance[1]),
            ("gyro.yaw_rad", gyro.yaw_rad),
            ("gyro.sweep_rate_radps", gyro.sweep_rate_radps),
            ("wheels.distance_m", wheels.distance_m),
        ])?;
        for (key, value) in [
            ("gyro.variance_rad2", gyro.variance_rad2),
            ("gyro.interval_s", gyro.interval_s),
            ("wheels.variance_m2", wheels.variance_m2),
            ("wheels.side_variance_m2", wheels.side_variance_m2),
            ("wheels.interval_s", wheels.interval_s),
            ("doppler.covariance[0]", doppler.covariance[0]),
            ("doppler.covariance[2]", doppler.covariance[2]),
        ] {
            require(
                value >= 0.0 && value.is_finite(),
                key,
                value,
                "finite, 0 or more",
            )?;
        }
        let points = self.points(values).ok_or_else(|| {
            let bytes = size_of_val(values);
            Violation(format!("its payload of {bytes} bytes is shorter than its header says: {rasters} rasters of {n} x {n} cells and {points} points"))
        })?;
        let is_finite = |point: &SparsePoint| {
            <[f32; 5]>::from(*point)
                .iter()
                .all(|value| value.is_finite())
        };
        match points.iter().position(|point| !is_finite(point)) {
            None => Ok(()),
            Some(index) => Err(Violation(format!(
                "point {index} is {:?}, but must be finite",
                points[index]
            ))),
        }
    }

    /// Returns the number of values of one raster, rounded up to whole blocks.
    fn raster_values(n: usize) -> Option<usize> {
        let cells = n.checked_mul(n)?;
        Some(FloatBlock::count(cells) * FloatBlock::LEN)
    }

    /// Returns the turn from the previous scan to this one, as the gyro has measured it; `None`
    /// where it has not.
    pub fn turn(&self) -> Option<GyroTurn> {
        (self.has_gyro == 1).then_some(self.gyro)
    }

    pub fn set_turn(&mut self, turn: Option<GyroTurn>) {
        self.gyro = turn.unwrap_or_default();
        self.has_gyro = turn.is_some().into();
    }

    /// Returns the distance from the previous scan to this one, as the wheels have measured it;
    /// `None` where they have not.
    pub fn distance(&self) -> Option<WheelDistance> {
        (self.has_wheels == 1).then_some(self.wheels)
    }

    pub fn set_distance(&mut self, distance: Option<WheelDistance>) {
        self.wheels = distance.unwrap_or_default();
        self.has_wheels = distance.is_some().into();
    }

    /// Returns the velocity by Doppler during this scan; `None` if the scan does not determine it.
    pub fn velocity(&self) -> Option<DopplerVelocity> {
        (self.has_doppler == 1).then_some(self.doppler)
    }

    pub fn set_velocity(&mut self, velocity: Option<DopplerVelocity>) {
        self.doppler = velocity.unwrap_or_default();
        self.has_doppler = velocity.is_some().into();
    }

    /// Splits a payload into its parts, with `rasters` (1 or 2) of n x n cells. `None` if it is too
    /// short.
    pub fn split(values: &mut [f32], n: usize, rasters: usize) -> Option<MaskedParts<'_>> {
        let raster = Self::raster_values(n)?;
        let (later, rest) = values.split_at_mut_checked(raster)?;
        let (earlier, rest) = match rasters {
            2 => rest
                .split_at_mut_checked(raster)
                .map(|(earlier, rest)| (Some(earlier), rest))?,
            _ => (None, rest),
        };
        let view = |values| ArrayViewMut2::from_shape((n, n), values).ok();
        let earlier = match earlier {
            Some(values) => Some(view(&mut values[..n * n])?),
            None => None,
        };
        let floats = size_of::<SparsePoint>() / size_of::<f32>();
        let whole = rest.len() / floats * floats;
        Some(MaskedParts {
            later: view(&mut later[..n * n])?,
            earlier,
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

    /// Returns the number of values before the points.
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
