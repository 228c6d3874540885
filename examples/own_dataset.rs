//! A dataset format of your own. Here it is a folder of files `STAMP.u8`: each is a sweep, 400
//! azimuths x 576 range bins without a header, named by the time of its middle, ns.
//!
//! ```sh
//! cargo run --release -p gyre-matching --example own_dataset -- FOLDER > trajectory.tum
//! ```

use std::{
    env,
    error::Error,
    f32::consts::TAU,
    fs, io,
    path::{Path, PathBuf},
};

use gyre_datasets::{
    DEFAULT_TURN_NS, Dataset, DatasetOptions, Format, ImageSize, InspectedLogs, Properties,
    ReadError, inspect_dataset, turn_ns, write_tum,
};
use gyre_geometry::{OwnedScan, ScanSlot, Sense, SweepGeometry, scan::flag};
use gyre_matching::odometry::{Odometry, OdometryConfig};
use gyre_radar::Trajectory;

const SIZE: ImageSize = ImageSize {
    width: 576,
    height: 400,
};
const BIN_M: f32 = 100.0 / 576.0;

/// A folder of sweeps.
pub(crate) struct RawSweeps {
    properties: Properties,
    files: Vec<PathBuf>,
    stamp_ns: Vec<i64>,
}

impl RawSweeps {
    /// Lists the sweeps in a folder, ordered by time.
    pub(crate) fn open(folder: &Path) -> Result<Self, Box<dyn Error>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            let stem = path.file_stem().and_then(|stem| stem.to_str());
            if let Some(stamp_ns) = stem.and_then(|stem| stem.parse::<i64>().ok()) {
                found.push((stamp_ns, path));
            }
        }
        found.sort();
        let (stamp_ns, files): (Vec<i64>, Vec<_>) = found.into_iter().unzip();
        let meaning = "the file name is the time of the middle of the sweep";
        Ok(Self {
            properties: Properties {
                period_ns: turn_ns(stamp_ns.iter().copied()).unwrap_or(DEFAULT_TURN_NS),
                ..Properties::of(Format::Other, files.len(), SIZE, meaning)
            },
            files,
            stamp_ns,
        })
    }
}

impl Dataset for RawSweeps {
    fn properties(&self) -> &Properties {
        &self.properties
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn nominal_stamp_ns(&self, index: usize) -> Option<i64> {
        self.stamp_ns.get(index).copied()
    }

    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError> {
        let len = self.len();
        let stamp_ns = self.nominal_stamp_ns(index);
        let stamp_ns = stamp_ns.ok_or(ReadError::NoSuchScan { index, len })?;
        let path = self.file(index).to_owned();
        let power = fs::read(&path).map_err(|source| ReadError::Io {
            path: path.clone(),
            source,
        })?;
        if power.len() != SIZE.bytes() {
            let (bytes, expected) = (power.len(), SIZE.bytes());
            let reason = format!("it has {bytes} bytes, not {expected}");
            return Err(ReadError::Damaged { path, reason });
        }
        slot.bytes[..SIZE.bytes()].copy_from_slice(&power);
        let (azimuths, period_ns) = (SIZE.height as i64, self.period_ns());
        for row in 0..SIZE.height {
            slot.azimuth_rad[row] = row as f32 * TAU / SIZE.height as f32;
            slot.stamp_ns[row] = stamp_ns + (row as i64 - azimuths / 2) * period_ns / azimuths;
            slot.flags[row] = flag::MEASURED;
        }
        Ok(SweepGeometry {
            azimuths: SIZE.height,
            bins: SIZE.width,
            stride: SIZE.width,
            first_byte: 0,
            range_resolution_m: BIN_M,
            range_offset_m: 0.0,
            doppler_s: 0.0,
            sense: Sense::Clockwise,
            stamp_ns,
        })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = env::args().nth(1).ok_or("usage: own_dataset FOLDER")?;
    let folder = Path::new(&folder);
    let (dataset, options) = (RawSweeps::open(folder)?, DatasetOptions::default());
    eprintln!(
        "{}",
        inspect_dataset(
            folder,
            Box::new(dataset),
            &options,
            &InspectedLogs::default()
        )
    );
    let trajectory = drive(&mut RawSweeps::open(folder)?)?;
    Ok(write_tum(&trajectory, &mut io::stdout().lock())?)
}

/// Registers the scans of any dataset.
pub(crate) fn drive(dataset: &mut dyn Dataset) -> Result<Trajectory, Box<dyn Error>> {
    let mut odometry = Odometry::new(&OdometryConfig::default())?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut trajectory = Trajectory::default();
    for index in 0..dataset.len() {
        scan.geometry = dataset.read(index, scan.slot())?;
        let registered = odometry.register(&scan.view(), &[])?;
        let stamps = trajectory.stamp_ns.get_or_insert_default();
        stamps.push(scan.geometry.stamp_ns);
        trajectory.poses.push(registered.pose.motion);
    }
    Ok(trajectory)
}
