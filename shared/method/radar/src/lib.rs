//! Polar radar scans: readers, ground truth, rasterisation.
//!
//! Reading order:
//! - [`scan`]: one sweep in the sensor's polar grid, borrowed for reading or for filling;
//! - [`mod@dataset`]: recordings on disk behind one trait, one file per format;
//! - [`fingerprint`]: what tells a recording from another one;
//! - [`lost`]: where azimuths of a turn were lost that has no measured angles;
//! - [`raster`]: from a scan to a Cartesian raster, with motion compensation;
//! - [`points`]: from a scan to sparse points, its strongest returns;
//! - [`mod@ground_truth`]: trajectories in the formats of datasets and tools, converted to REP-103;
//! - [`mod@inspect`]: a summary of a recording and of its faults.

mod chain;
mod clock;
pub mod dataset;
pub mod fingerprint;
mod gnss_log;
mod gps_imu_twist;
pub mod ground_truth;
mod gyro_log;
pub mod inspect;
pub mod lost;
mod median;
mod plain_words;
pub mod points;
mod quoted;
pub mod raster;
pub mod scan;
mod scan_samples;
mod stretches;
pub mod trajectory;
mod wheel_log;

pub use chain::{MAX_INTERVAL_NS, continues};
pub use clock::{ClockOffset, MAX_OFFSET_S, clock_offset};
pub use dataset::{
    AzimuthSource, DEFAULT_TURN_NS, Dataset, DatasetOptions, EncoderTurn, FIRST_TURNS, FileList,
    Format, ImageSize, ImageSource, LostAzimuthOption, OpenError, ReadError, correct_eccentricity,
    encoder_counts, foreign, frame_stamps, middle_ns, open, open_resolved, open_source,
    parse_seconds, reopen, stamp_to_ns, stored_options, turn_ns,
};
pub use fingerprint::Fingerprint;
pub use gnss_log::{GnssFaults, GnssLog, GnssLogError, LoggedFix};
pub use ground_truth::{
    TrajectoryError, find_ground_truth, parse_trajectory, read_trajectory, write_kitti, write_tum,
};
pub use gyro_log::{GyroLog, LogError, LogFaults, LogGap, SampleTrack};
pub use inspect::{Report, inspect, inspect_dataset};
pub use lost::{LostAzimuthFinder, LostAzimuths, PlacedRows};
pub use median::median;
pub use plain_words::in_plain_words;
pub use points::{PointExtractor, PointsConfig, PointsError};
pub use quoted::quoted;
pub use raster::{RasterConfig, RasterError, Rasteriser, Sampling};
pub use scan::{
    MAX_AZIMUTHS, OwnedScan, PolarScan, ScanError, ScanLimits, ScanSlot, Sense, SweepGeometry,
};
pub use scan_samples::ScanSamples;
pub use trajectory::Trajectory;
pub use wheel_log::WheelLog;
