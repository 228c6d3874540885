//! Exact ground truth beside a dataset of any format: `ground_truth.tum`, the pose at the time of
//! each scan, and `azimuth_poses.npy`, the pose at the time of each azimuth.
//!
//! The latter is a NumPy array (format 1.0, `<f8`) of shape (scans, azimuths, 4): seconds since the
//! first azimuth of the first scan; x and y in the world, metres; yaw, radians counter-clockwise.
//! It takes 12.8 MB for 1,000 scans of 400 azimuths, and `numpy.load(path, mmap_mode="r")` opens
//! it. The header is written here since `ndarray-npy` and `npyz` would add a Python parser (pest)
//! and a C build for these ten lines.

use gyre_geometry::Pose;
use gyre_radar::Trajectory;

use crate::simulator::Simulator;

/// `ground_truth.tum` as bytes. `stamps_ns` are the times of the scans.
pub(crate) fn ground_truth_tum(simulator: &Simulator, stamps_ns: Vec<i64>) -> Vec<u8> {
    let poses = stamps_ns
        .iter()
        .enumerate()
        .map(|(index, ns)| pose_at(simulator, index, *ns))
        .collect();
    let mut text = Vec::new();
    // Writing to memory cannot fail, and there are stamps.
    let _ = gyre_datasets::write_tum(
        &Trajectory {
            stamp_ns: Some(stamps_ns),
            poses,
        },
        &mut text,
    );
    text
}

fn pose_at(simulator: &Simulator, index: usize, stamp_ns: i64) -> Pose {
    let epoch_ns = simulator.time(index).epoch_us * 1000;
    simulator.path().pose((stamp_ns - epoch_ns) as f64 * 1e-9)
}

/// `azimuth_poses.npy` as bytes.
pub(crate) fn azimuth_poses_npy(simulator: &Simulator) -> Vec<u8> {
    let (scans, azimuths) = (simulator.scans(), simulator.sampling().azimuths);
    let mut bytes = npy_header(scans, azimuths);
    bytes.reserve(scans * azimuths * 4 * size_of::<f64>());
    for index in 0..scans {
        let time = simulator.time(index);
        for azimuth in 0..azimuths {
            let time_s = time.drive_time_s(time.stamp_us(azimuth));
            let pose = simulator.path().pose(time_s);
            for value in [
                time_s,
                pose.translation.x,
                pose.translation.y,
                pose.rotation.angle(),
            ] {
                bytes.extend(value.to_le_bytes());
            }
        }
    }
    bytes
}

/// Magic, version 1.0, the header's length, and a Python dictionary padded to a multiple of 64
/// bytes.
fn npy_header(scans: usize, azimuths: usize) -> Vec<u8> {
    let dictionary =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({scans}, {azimuths}, 4), }}");
    let before = 10;
    let padded = (before + dictionary.len() + 1).next_multiple_of(64) - before;
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((padded as u16).to_le_bytes());
    header.extend(format!("{dictionary:<width$}\n", width = padded - 1).into_bytes());
    header
}
