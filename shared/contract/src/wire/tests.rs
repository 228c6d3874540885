//! Each topic's checks: a header out of its bounds is refused by a sentence with the field.

use bytemuck::Zeroable;
use gyre_geometry::samples::Sample;

use crate::{
    ByteBlock, Correction, CorrectionHeader, Fix, FixHeader, FloatBlock, Item, Limits, Loop,
    LoopHeader, Masked, MaskedHeader, Message, Motion, MotionHeader, Object, Objects,
    ObjectsHeader, Pose, PoseHeader, Rotation, RotationHeader, Scan, ScanHeader, flag,
    wire::Described,
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
fn a_header_is_finite_and_within_its_bounds() {
    refused! { Rotation, RotationHeader::default(), &[];
        "flags is 16": |it| it.item.flags = 16,
        "previous_scan is 3": |it| it.item.previous_scan = 3,
        "numbered_from is 2": |it| it.item.numbered_from = 2,
        "rotation.angle_rad is NaN": |it| it.rotation.angle_rad = f64::NAN,
        "rotation.angle_rad is -3.5": |it| it.rotation.angle_rad = -3.5,
        "rotation.variance_rad2 is -1": |it| it.rotation.variance_rad2 = -1.0,
        "rotation.score is inf": |it| it.rotation.score = f64::INFINITY,
    }
    refused! { Motion, MotionHeader::default(), &[];
        "motion.x_m is NaN": |it| it.motion.x_m = f64::NAN,
        "motion.y_m is -61": |it| it.motion.y_m = -61.0,
        "motion.yaw_rad is 3.2": |it| it.motion.yaw_rad = 3.2,
        "motion.searched[0] is 6.5": |it| it.motion.searched[0] = 6.5,
        "motion.covariance": |it| it.motion.covariance[1] = 1.0,
        "motion.interval_ns is -1": |it| it.motion.interval_ns = -1,
        "motion.score is NaN": |it| it.motion.score = f64::NAN,
        "motion.rotation.angle_rad is 9": |it| it.motion.rotation.angle_rad = 9.0,
        "motion.refinement.outcome is 4": |it| it.motion.refinement.outcome = 4,
        "motion.refinement.overlap is NaN": |it| it.motion.refinement.overlap = f64::NAN,
        "motion.refinement.witnesses[1].verdict is 4": |it| it.motion.refinement.witnesses[1].verdict = 4,
        "motion.refinement.witnesses[2].scale is NaN": |it| it.motion.refinement.witnesses[2].scale = f64::NAN,
    }
    refused! { Pose, PoseHeader::default(), &[];
        "x_m is NaN": |it| it.x_m = f64::NAN,
        "y_m is 1000000000": |it| it.y_m = 1e9,
        "covariance": |it| it.covariance[0] = -1.0,
        "motion.x_m is inf": |it| it.motion.x_m = f64::INFINITY,
    }
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
    let header = CorrectionHeader {
        keyframes: 1,
        ..CorrectionHeader::default()
    };
    refused! { Correction, header, &[];
        "x_m is inf": |it| it.x_m = f64::INFINITY,
        "yaw_rad is 4": |it| it.yaw_rad = 4.0,
        "keyframe_covariance": |it| it.keyframe_covariance[0] = f64::NAN,
        "keyframes is 0": |it| it.keyframes = 0,
    }
    refused! { Fix, FixHeader::default(), &[];
        "y_m is inf": |it| it.y_m = f64::INFINITY,
        "yaw_rad is 4": |it| it.yaw_rad = 4.0,
        "covariance": |it| it.covariance[0] = -1.0,
        "correlation is NaN": |it| it.correlation = f64::NAN,
        "status is 4": |it| it.status = 4,
    }
    let car = Object {
        x_m: 20.0,
        yaw_rad: 3.0,
        length_m: 4.4,
        width_m: 1.9,
        ..Object::default()
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
        "list[1].y_m": |it| it.list[1].y_m = f64::INFINITY,
        "list[1].yaw_rad": |it| it.list[1].yaw_rad = 4.0,
        "list[0].vx_mps": |it| it.list[0].vx_mps = f64::NAN,
        "list[1].width_m": |it| it.list[1].width_m = -1.0,
        "list[0].velocity_covariance[2]": |it| it.list[0].velocity_covariance[2] = f64::NAN,
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

#[test]
fn a_value_has_its_name_and_what_has_a_meaning() {
    let mut header = ObjectsHeader {
        objects: 1,
        listed: 1,
        ..ObjectsHeader::default()
    };
    header.item.stamp_ns = -7;
    header.list[0].position_covariance = [1.0, 0.5, f64::NAN];
    let structure = &ObjectsHeader::STRUCTURE;
    let printed = |path: &str| {
        let value = structure.value(path, bytemuck::bytes_of(&header));
        value.map(|it| serde_json::to_string(&it).unwrap_or_default())
    };
    assert_eq!(printed("item.stamp_ns").as_deref(), Some("-7"));
    assert_eq!(printed("item.missing"), None);
    let object = printed("list").unwrap_or_default();
    assert!(object.starts_with("[{\"id\":0,") && object.ends_with("\"age\":0}]"));
    assert!(object.contains("\"position_covariance\":[1.0,0.5,null]"));
}
