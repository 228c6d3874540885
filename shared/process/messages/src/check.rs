//! Checks of messages where they enter a process: the sender may be any program. A violation is a
//! sentence with the field, its value and its bounds.

use std::{f64::consts::PI, fmt::Display, ops::RangeInclusive};

use gyre_geometry::covariance;

/// Tolerance for a yaw of pi, rad.
const ROUNDING_RAD: f64 = 1e-9;

pub(crate) fn require(
    holds: bool,
    field: &str,
    value: impl Display,
    expected: impl Display,
) -> Result<(), String> {
    match holds {
        true => Ok(()),
        false => Err(format!("{field} is {value}, but must be {expected}")),
    }
}

/// Requires a value within bounds, and so a finite one.
pub(crate) fn within(field: &str, value: f64, bounds: RangeInclusive<f64>) -> Result<(), String> {
    let (first, last) = bounds.clone().into_inner();
    let expected = format_args!("from {first} to {last}");
    require(bounds.contains(&value), field, value, expected)
}

/// Requires a code from 0 to `last`.
pub(crate) fn code(field: &str, value: impl Into<u64>, last: impl Into<u64>) -> Result<(), String> {
    let (value, last) = (value.into(), last.into());
    require(value <= last, field, value, format_args!("0 to {last}"))
}

/// Numbers with the names of their fields.
macro_rules! fields {
    ($of:expr; $($field:ident)+) => {
        [$((stringify!($field), $of.$field)),+]
    };
}
pub(crate) use fields;

pub(crate) fn finite<const N: usize>(fields: [(&str, f64); N]) -> Result<(), String> {
    fields
        .into_iter()
        .try_for_each(|(field, value)| require(value.is_finite(), field, value, "finite"))
}

pub(crate) fn not_negative<const N: usize>(fields: [(&str, f64); N]) -> Result<(), String> {
    let holds = |value: f64| value >= 0.0 && value.is_finite();
    fields
        .into_iter()
        .try_for_each(|(field, value)| require(holds(value), field, value, "finite, 0 or more"))
}

/// Names the part of a message whose field is wrong.
pub(crate) fn of(part: &str, checked: Result<(), String>) -> Result<(), String> {
    checked.map_err(|text| format!("{part}{text}"))
}

/// Requires x and y (m) within `reach_m` and yaw (rad) within half a turn.
pub(crate) fn planar([x, y, yaw]: [(&str, f64); 3], reach_m: f64) -> Result<(), String> {
    within(x.0, x.1, -reach_m..=reach_m)?;
    within(y.0, y.1, -reach_m..=reach_m)?;
    within(yaw.0, yaw.1, -PI - ROUNDING_RAD..=PI + ROUNDING_RAD)
}

pub(crate) fn covariance(packed: &covariance::Packed) -> Result<(), String> {
    match covariance::is_positive_semidefinite(packed) {
        true => Ok(()),
        false => Err(format!(
            "covariance is {packed:?}, but must be finite and positive semidefinite"
        )),
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use gyre_samples::Sample;

    use crate::{
        ByteBlock, Correction, CorrectionHeader, Fix, FixHeader, FloatBlock, Item, Limits,
        ListedObject, Loop, LoopHeader, Masked, MaskedHeader, Message, Motion, MotionHeader,
        Objects, ObjectsHeader, Pose, PoseHeader, Rotation, RotationHeader, Scan, ScanHeader, flag,
    };

    const LIMITS: Limits = Limits {
        scan_bytes: 64,
        raster_cells: 9,
        cell_m: 2.0,
        rasters: 1,
        points: 2,
        samples: 2,
    };

    fn is_refused<M: Message>(header: &M::Header, payload: &[M::Element], start: &str) {
        let violation = M::check(header, payload, &LIMITS);
        let is_it = violation.as_ref().is_err_and(|it| it.starts_with(start));
        assert!(is_it, "{start}: {violation:?}");
    }

    type Change<'a, H> = (&'a str, &'a dyn Fn(&mut H));

    /// Asserts that a header is accepted, that each of the changes makes it refused for its field,
    /// and that the end of the stream needs no content.
    fn each_is_refused<M: Message>(
        header: M::Header,
        payload: &[M::Element],
        changes: &[Change<'_, M::Header>],
    ) where
        M::Header: Copy,
    {
        assert_eq!(M::check(&header, payload, &LIMITS), Ok(()));
        for (field, change) in changes {
            let mut changed = header;
            change(&mut changed);
            is_refused::<M>(&changed, payload, field);
            *crate::Header::item_mut(&mut changed) = Item::default().flagged(flag::END);
            assert_eq!(M::check(&changed, &[], &LIMITS), Ok(()), "{field}");
        }
    }

    /// See [`each_is_refused`]: the start of each sentence, and the change that it refuses.
    macro_rules! refused {
        ($message:ty, $header:expr, $payload:expr; $($start:literal: $change:expr,)+) => {
            each_is_refused::<$message>($header, $payload, &[$(($start, &$change)),+])
        };
    }

    #[test]
    fn motions_and_places_are_finite_and_within_their_bounds() {
        refused! { Rotation, RotationHeader::default(), &[];
            "flags is 16": |it| it.item.flags = 16,
            "previous_scan is 3": |it| it.item.previous_scan = 3,
            "numbered_from is 2": |it| it.item.numbered_from = 2,
            "angle_rad is NaN": |it| it.rotation.angle_rad = f64::NAN,
            "angle_rad is -3.5": |it| it.rotation.angle_rad = -3.5,
            "variance_rad2 is -1": |it| it.rotation.variance_rad2 = -1.0,
            "score is inf": |it| it.rotation.score = f64::INFINITY,
        }
        refused! { Motion, MotionHeader::default(), &[];
            "x_m is NaN": |it| it.motion.x_m = f64::NAN,
            "y_m is -61": |it| it.motion.y_m = -61.0,
            "yaw_rad is 3.2": |it| it.motion.yaw_rad = 3.2,
            "searched[0] is 6.5": |it| it.motion.searched[0] = 6.5,
            "covariance": |it| it.motion.covariance[1] = 1.0,
            "interval_ns is -1": |it| it.motion.interval_ns = -1,
            "score is NaN": |it| it.motion.score = f64::NAN,
            "angle_rad is 9": |it| it.motion.rotation.angle_rad = 9.0,
            "outcome is 4": |it| it.motion.refinement.outcome = 4,
            "overlap is NaN": |it| it.motion.refinement.overlap = f64::NAN,
        }
        refused! { Pose, PoseHeader::default(), &[];
            "x_m is NaN": |it| it.x_m = f64::NAN,
            "y_m is 1000000000": |it| it.y_m = 1e9,
            "covariance": |it| it.covariance[0] = -1.0,
            "x_m is inf": |it| it.motion.x_m = f64::INFINITY,
        }
        let header = CorrectionHeader {
            keyframes: 1,
            ..CorrectionHeader::default()
        };
        refused! { Correction, header, &[];
            "x_m is inf": |it| it.x_m = f64::INFINITY,
            "yaw_rad is 4": |it| it.yaw_rad = 4.0,
            "covariance": |it| it.keyframe_covariance[0] = f64::NAN,
            "keyframes is 0": |it| it.keyframes = 0,
        }
        refused! { Fix, FixHeader::default(), &[];
            "y_m is inf": |it| it.y_m = f64::INFINITY,
            "yaw_rad is 4": |it| it.yaw_rad = 4.0,
            "covariance": |it| it.covariance[0] = -1.0,
            "correlation is NaN": |it| it.correlation = f64::NAN,
            "status is 4": |it| it.status = 4,
        }
    }

    #[test]
    fn loops_and_objects_are_finite_and_within_their_bounds() {
        let header = LoopHeader {
            later_seq: 9,
            earlier_seq: 2,
            loops: 1,
            ..LoopHeader::default()
        };
        refused! { Loop, header, &[];
            "earlier_seq is 9": |it| it.earlier_seq = 9,
            "x_m is 6.5": |it| it.x_m = 6.5,
            "yaw_rad is NaN": |it| it.yaw_rad = f64::NAN,
            "covariance": |it| it.covariance[0] = -1.0,
            "correlation is 1.5": |it| it.correlation = 1.5,
            "loops is 0": |it| it.loops = 0,
        }
        let car = ListedObject {
            x_m: 20.0,
            yaw_rad: 3.0,
            length_m: 4.4,
            width_m: 1.9,
            ..ListedObject::default()
        };
        let mut header = ObjectsHeader {
            objects: 2,
            moving: 1,
            listed: 2,
            ..ObjectsHeader::default()
        };
        header.list[..2].fill(car);
        refused! { Objects, header, &[];
            "x_m": |it| it.x_m = f64::NAN,
            "moving": |it| it.moving = 3,
            "listed": |it| it.listed = 1,
            "an object's y_m": |it| it.list[1].y_m = f64::INFINITY,
            "an object's yaw_rad": |it| it.list[1].yaw_rad = 4.0,
            "an object's vx_mps": |it| it.list[0].vx_mps = f64::NAN,
            "an object's width_m": |it| it.list[1].width_m = -1.0,
            "an object's covariance": |it| it.list[0].velocity_covariance[2] = f64::NAN,
        }
        // Unlisted entries are not checked.
        header.list[2].y_m = f64::NAN;
        assert_eq!(Objects::check(&header, &[], &LIMITS), Ok(()));
        (header.objects, header.listed, header.list[2].y_m) = (100, 64, 0.0);
        assert_eq!(Objects::check(&header, &[], &LIMITS), Ok(()));
    }

    #[test]
    fn rasters_and_points_are_as_many_as_the_run_allows_and_in_the_payload() {
        let header = MaskedHeader {
            n: 3,
            rasters: 1,
            cell_m: 2.0,
            points: 2,
            ..MaskedHeader::default()
        };
        let payload = [FloatBlock::zeroed(); 4];
        refused! { Masked, header, &payload;
            "n is 4": |it| it.n = 4,
            "rasters is 2": |it| it.rasters = 2,
            "cell_m is 0.5": |it| it.cell_m = 0.5,
            "points is 3": |it| it.points = 3,
            "mask is 3": |it| it.mask = 3,
            "twist[1] is NaN": |it| it.twist[1] = f32::NAN,
        }
        assert!(Masked::check(&header, &payload[..1], &LIMITS).is_err());
        let mut values = [0.0_f32; 64];
        values[16 + 5] = f32::NAN;
        let blocks: &[FloatBlock] = &values
            .chunks_exact(16)
            .map(|values| bytemuck::pod_read_unaligned(bytemuck::cast_slice(values)))
            .collect::<Vec<_>>();
        is_refused::<Masked>(&header, blocks, "point 1 is");
    }

    #[test]
    fn a_scan_is_one_sweep_in_its_payload() {
        let mut header = ScanHeader {
            azimuths: 4,
            bins: 10,
            stride: 16,
            range_resolution_m: 0.1,
            ..ScanHeader::default()
        };
        let second_ns = 1_000_000_000;
        header.item.stamp_ns = second_ns;
        header.azimuth_stamp_ns[..4].fill(second_ns);
        refused! { Scan, header, &[ByteBlock::zeroed()];
            "azimuths is 0": |it| it.azimuths = 0,
            "azimuths is 9999": |it| it.azimuths = 9999,
            "its payload of 64 bytes is shorter": |it| it.bins = 17,
            "its payload of 64 bytes is shorter": |it| it.first_byte = u32::MAX,
            "the scan's range resolution": |it| it.range_resolution_m = f32::NAN,
            "the scan's stamp": |it| it.item.stamp_ns = 12_000_000_000,
            "row 2: stamp": |it| it.azimuth_stamp_ns[2] = 12_000_000_000,
            "azimuth 3": |it| it.azimuth_rad[3] = f32::INFINITY,
        }
    }

    #[test]
    fn samples_of_a_scan_are_finite_and_each_is_later_than_the_one_before() {
        let mut header = ScanHeader {
            azimuths: 1,
            bins: 10,
            stride: 10,
            range_resolution_m: 0.1,
            ..ScanHeader::default()
        };
        let mut payload = [ByteBlock::zeroed(); 3];
        let good = [1, 2].map(|ns| Sample::yaw_rate(ns, 0.5));
        header.set_samples(bytemuck::cast_slice_mut(&mut payload), &good, 0);
        refused! { Scan, header, &payload;
            "samples is 3": |it| it.samples = 3,
            "its payload of 192 bytes is shorter": |it| (it.stride, it.azimuths) = (64, 2),
        }
        let unknown = Sample { kind: 9, ..good[1] };
        for (bad, expected) in [
            (Sample::yaw_rate(2, f64::NAN), "sample 1 is"),
            (Sample::yaw_rate(2, 40.0), "sample 1 is"),
            (unknown, "sample 1 is"),
            (Sample::yaw_rate(1, 0.5), "a sample is not later"),
        ] {
            let bytes = bytemuck::cast_slice_mut(&mut payload);
            header.set_samples(bytes, &[good[0], bad], 0);
            is_refused::<Scan>(&header, &payload, expected);
        }
    }
}
