//! The section `[source]`: where scans come from.

use std::{num::NonZeroUsize, ops::Range, path::PathBuf};

use serde::{Deserialize, Serialize};

gyre_geometry::named! {
    /// Where scans come from.
    #[derive(
        Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
    )]
    #[serde(rename_all = "kebab-case")]
    pub enum SourceKind {
        /// A recording, or a simulation.
        #[default]
        Recording = "recording",
        /// A Navtech radar on the network, by its protocol Colossus or as ASTERIX CAT-240.
        Colossus = "colossus",
        /// A Navtech radar behind its driver in ROS 2.
        Ros2 = "ros2",
    }
}

/// The source of scans: section `[source]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceConfig {
    /// `recording`; or in live mode `colossus`, a Navtech radar on the network, or `ros2`, one
    /// behind its driver in ROS 2. Then `data`, `first`, `retry_s` and `max_unreadable` are not
    /// used.
    pub kind: SourceKind,
    /// Address of the radar, as in `192.168.0.1`; its port is 6317 unless it is given.
    /// `udp://GROUP:PORT`: where a radar sends to whose data output is CAT-240, as in
    /// `udp://239.192.43.78:4378`.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub address: String,
    /// Topic of ROS 2 on which Navtech's driver publishes azimuths, as in `/radar_data/fft_data`;
    /// `--ros2` on the command line. Its configuration is beside it,
    /// `/radar_data/configuration_data`.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub topic: String,
    /// Domain of ROS 2. Default: `ROS_DOMAIN_ID`, or 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub domain: Option<u16>,
    /// Address of this machine on the network of a radar that sends to a multicast group, as in
    /// `192.168.0.2`. Default: the system chooses. Of ROS 2 the only network that is used; default:
    /// all.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub interface: String,
    /// Time without an azimuth before the radar is connected again, or in ROS 2 before that is
    /// reported, s; 0: no limit.
    pub silence_s: f64,
    /// Folder of the recording.
    pub data: PathBuf,
    /// First topic that is played from a recording of a run: `scan`, `masked`, `rotation`, `motion`
    /// or `refined`; `--from` on the command line. The stages before it are absent. Of all but
    /// `scan` every message must have been recorded.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub from: PlayedFrom,
    /// Commands to give at the times that it has: `journal/commands.jsonl` of another run of the
    /// same scans, whose poses this run then repeats.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub commands: Option<PathBuf>,
    /// First scan to play, from 0.
    pub first: usize,
    /// Number of scans to play. Default: all, and of a radar without end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<usize>,
    /// Play the recording again and again, with times that advance: `gyre stress`. `scans` then
    /// counts the scans of all turns; without it the run has no end.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    #[schemars(skip)]
    pub repeat: bool,
    /// Number of scans that become due at once, as from a network that holds them back; the mean
    /// rate stays. They follow each other as fast as they are decoded. Only with a `run.rate` other
    /// than `max`.
    #[serde(skip_serializing_if = "is_one")]
    #[schemars(skip)]
    pub burst: NonZeroUsize,
    /// Time for which a file that the disk or the network does not give is tried again, s. Then the
    /// run ends, and the same command continues it.
    pub retry_s: f64,
    /// Number of damaged scans in a row that are skipped; one more ends the run. Over ten scans at
    /// four per second a car drives farther than the search reaches.
    pub max_unreadable: usize,
}

fn is_one(value: &NonZeroUsize) -> bool {
    value.get() == 1
}

impl Default for SourceConfig {
    fn default() -> Self {
        Self {
            kind: SourceKind::Recording,
            address: String::new(),
            topic: String::new(),
            domain: None,
            interface: String::new(),
            silence_s: 3.0,
            data: PathBuf::new(),
            from: PlayedFrom::Scan,
            commands: None,
            first: 0,
            scans: None,
            repeat: false,
            burst: NonZeroUsize::MIN,
            retry_s: 10.0,
            max_unreadable: 10,
        }
    }
}

impl SourceConfig {
    /// Returns the scans to play of a recording that has these, by their index in it.
    pub fn played(&self, scans: Range<usize>) -> Range<usize> {
        let first = self.first.max(scans.start).min(scans.end);
        let end = first.saturating_add(self.scans.unwrap_or(usize::MAX));
        first..end.min(scans.end)
    }

    /// Returns the scans of the stream that is played of a recording that has these, counted on
    /// through all turns. It ends at `usize::MAX` if it is without end.
    pub fn stream(&self, scans: Range<usize>) -> Range<usize> {
        let once = self.played(scans);
        match self.repeat && !once.is_empty() {
            true => once.start..once.start.saturating_add(self.scans.unwrap_or(usize::MAX)),
            false => once,
        }
    }

    /// Returns the number of scans of [`stream`](Self::stream); `None`: without end.
    pub fn stream_len(&self, scans: Range<usize>) -> Option<usize> {
        let stream = self.stream(scans);
        (stream.end < usize::MAX).then_some(stream.len())
    }
}

gyre_geometry::named! {
    /// The first topic that is played from a recording: the stages that compute it, and all stages
    /// before, are absent.
    #[derive(
        Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
    )]
    #[serde(rename_all = "kebab-case")]
    pub enum PlayedFrom {
        /// Scans: all stages compute.
        #[default]
        Scan = "scan",
        /// Masked scans.
        Masked = "masked",
        /// Rotations, beside masked scans.
        Rotation = "rotation",
        /// Searched motions, beside masked scans.
        Motion = "motion",
        /// Refined motions.
        Refined = "refined",
    }
}

impl PlayedFrom {
    /// Returns the topics that the stages after it read. `reads_masked`: the last stage reads
    /// masked scans, for the keyframes of SLAM.
    pub fn topics(self, refines: bool, reads_masked: bool) -> Vec<&'static str> {
        match self {
            Self::Scan => vec!["scan"],
            Self::Masked => vec!["masked"],
            Self::Rotation => vec!["masked", "rotation"],
            Self::Motion if refines || reads_masked => vec!["masked", "motion"],
            Self::Motion => vec!["motion"],
            Self::Refined if reads_masked => vec!["masked", "refined"],
            Self::Refined => vec!["refined"],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_that_repeats_has_no_end_unless_its_scans_are_counted() {
        let stream = |repeat, scans, once: Range<usize>| {
            let source = SourceConfig {
                repeat,
                scans,
                ..SourceConfig::default()
            };
            source.stream(once)
        };
        assert_eq!(stream(false, Some(100), 3..10), 3..10);
        assert_eq!(stream(true, Some(100), 3..10), 3..103);
        assert_eq!(stream(true, None, 3..10), 3..usize::MAX);
        assert_eq!(stream(true, None, 3..3), 3..3);
    }
}
