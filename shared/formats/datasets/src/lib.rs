//! Recordings of radars on disk, and what lies beside them. Begin with
//! [`mod@dataset`]: the scans of a recording behind one trait.

pub mod dataset;
pub mod fingerprint;
pub mod ground_truth;
mod header;
mod inspect;
mod plain_words;
mod sample_log;
mod scan_samples;

pub use dataset::{
    AzimuthSource, DEFAULT_TURN_NS, Dataset, DatasetOptions, EncoderTurn, FIRST_TURNS, Format,
    ImageSize, ImageSource, LostAzimuthOption, OpenError, Properties, ReadError, check_first_scan,
    correct_eccentricity, encoder_counts, frame_stamps, is_dataset, middle_ns, open, open_resolved,
    open_source, parse_seconds, reopen, stamp_to_ns, stored_options, turn_ns,
};
pub use fingerprint::Fingerprint;
pub use ground_truth::{
    TrajectoryError, find_ground_truth, parse_trajectory, read_trajectory, write_kitti, write_tum,
};
pub use inspect::{InspectedLogs, Report, inspect, inspect_dataset};
pub use plain_words::{clipped, in_plain_words};
pub use sample_log::{LogError, LogFaults, LogGap, ReceivedFixes, SampleLog};
pub use scan_samples::ScanSamples;
