//! The bounds of all values, and the sections that must fit each other.

use std::collections::BTreeMap;

use gyre_colossus::Address;
use gyre_messages::StageId;
use gyre_ros2_messages::Domain;
use gyre_run::{
    Limits, Mode, PlayedFault, PlayedFrom, Rate, Side, SourceConfig, SourceKind, StageConfig,
};
use gyre_samples::{GnssKind, GyroKind, WheelsKind};
use gyre_simulator::OutputFormat;
use gyre_slam::SlamKind;

use super::Configuration;
use crate::{
    error::ConfigurationError,
    method::MethodConfig,
    strict::{value, within},
};

impl Configuration {
    /// Checks every section, then all together.
    pub(super) fn validate(&self) -> Result<(), ConfigurationError> {
        let method = MethodConfig {
            dataset: self.dataset,
            odometry: self.odometry.clone(),
            slam: self.slam.clone(),
            gnss: self.gnss.clone(),
            objects: self.objects.clone(),
        };
        method.validate()?;
        within("run", self.window(None, 1).validate())?;
        self.validate_simulation()?;
        self.validate_points()?;
        self.validate_times()?;
        within("run", self.run.scheduling.validate())?;
        for (name, stage) in &self.stages {
            let section = format!("stages.{name}");
            within(&section, stage.scheduling.validate())?;
            if stage.python.is_some() && !stage.command.is_empty() {
                let reason = "command and python are both set, but one program takes the place of the stage: remove one of them";
                return Err(value(&section, reason));
            }
            if stage.python.is_some()
                && let Err(reason) = StageConfig::function(name)
            {
                return Err(value(&section, format!("python is set, but {reason}")));
            }
            let is_absent = StageId::by_name(name).is_some_and(|stage| self.is_absent(stage));
            if stage.python.is_some() && is_absent {
                let reason = "python is set, but this run has no such stage: see search.kind and source.from";
                return Err(value(&section, reason));
            }
        }
        if !(0.0..=50.0).contains(&self.slam.submap_reach_m) {
            return Err(value(
                "slam",
                "submap_reach_m is out of its bounds: expected 0 to 50 m",
            ));
        }
        if !self.slam.is_on() && !self.slam.map.as_os_str().is_empty() {
            let reason = "map is set, but the keyframes that are found in it are those of slam: set kind to `graph`";
            return Err(value("slam", reason));
        }
        self.validate_logs()?;
        self.validate_gnss()?;
        self.validate_listen()?;
        if self.objects.is_on() && self.link.side.is_some() {
            let reason = "kind is `tracks`, but a run that is split between two machines (link.side) logs no points: set kind to `none`";
            return Err(value("objects", reason));
        }
        self.validate_radar()?;
        self.validate_budget()?;
        self.validate_record()?;
        self.validate_link()?;
        if self.source.burst.get() > 1 && self.run.rate == Rate::Max {
            let reason = "burst needs a pace: set run.rate to `realtime` or a factor";
            return Err(value("source", reason));
        }
        self.validate_played_from()?;
        self.validate_faults()?;
        let has_scans = !self.is_radar() && !self.is_side(Side::Base);
        if self.run.mode == Mode::Live && self.run.rate == Rate::Max && has_scans {
            let reason = "mode `live` needs a radar's pace: set rate to `realtime` or a factor";
            return Err(value("run", reason));
        }
        Ok(())
    }

    /// A log that is used is named.
    fn validate_logs(&self) -> Result<(), ConfigurationError> {
        let odometry = &self.odometry;
        let (gyro, wheels, gnss) = (&odometry.gyro, &odometry.wheels, &self.gnss);
        for (section, is_log, file) in [
            ("gyro", gyro.kind == GyroKind::Log, &gyro.file),
            ("wheels", wheels.kind == WheelsKind::Log, &wheels.file),
            ("gnss", gnss.kind == GnssKind::Log, &gnss.file),
        ] {
            let is_named = file.as_ref().is_some_and(|it| !it.as_os_str().is_empty());
            if is_log && !is_named {
                let reason = "kind is `log`, but no file is named: set file, or kind to `auto`";
                return Err(value(section, reason));
            }
        }
        Ok(())
    }

    /// Fixes are constraints of a graph. The fixes of a recording are in a log. Those beside a live
    /// radar arrive during the run, or are in a log that is complete when it begins.
    fn validate_gnss(&self) -> Result<(), ConfigurationError> {
        let reason = match self.gnss.kind {
            GnssKind::None => return Ok(()),
            _ if self.slam.kind != SlamKind::Graph => {
                "kind is set, but fixes are constraints of the graph of slam: set slam.kind to `graph`"
            }
            GnssKind::Auto if self.is_radar() => {
                "kind is `auto`, but the log of a live radar does not lie beside its scans: receive fixes with kind = \"udp\" or \"ros2\", or name a log with kind = \"log\" and file"
            }
            GnssKind::Udp if !self.is_radar() && !self.is_side(Side::Base) => {
                "kind is `udp`, but the scans are of no live radar: set kind to `auto`, or name a log with kind = \"log\" and file"
            }
            GnssKind::Ros2 if self.source.kind != SourceKind::Ros2 => {
                "kind is `ros2`, but the radar is not behind its driver in ROS 2: receive fixes with kind = \"udp\", or name a log with kind = \"log\" and file"
            }
            _ => return Ok(()),
        };
        Err(value("gnss", reason))
    }

    /// Checks that no two live sensors receive at one address.
    fn validate_listen(&self) -> Result<(), ConfigurationError> {
        let odometry = &self.odometry;
        let (gyro, wheels, gnss) = (&odometry.gyro, &odometry.wheels, &self.gnss);
        let sensors = [
            ("gyro", gyro.kind == GyroKind::Udp, &gyro.listen),
            ("wheels", wheels.kind == WheelsKind::Udp, &wheels.listen),
            ("gnss", gnss.is_live(), &gnss.listen),
        ];
        let mut taken = BTreeMap::new();
        for (section, _, listen) in sensors.into_iter().filter(|(_, is_live, _)| *is_live) {
            if let Some(other) = taken.insert(listen, section) {
                let reason = format!("listen is {listen}, as that of {other}: set another port");
                return Err(value(section, reason));
            }
        }
        Ok(())
    }

    /// A recording that takes the place of stages is a recording of a run, and has the topic of a
    /// stage that the run has.
    fn validate_played_from(&self) -> Result<(), ConfigurationError> {
        let from = self.source.from;
        if from == PlayedFrom::Scan {
            return Ok(());
        }
        let reason = match from {
            _ if self.run.mode == Mode::Live => "in mode `live` nothing but scans can be played",
            _ if self.source.first > 0 => "first must be 0: the stages need all messages before",
            _ => match self.lacks(from) {
                Some(reason) => reason,
                None => return Ok(()),
            },
        };
        let from = from.name();
        Err(value("source", format!("from is `{from}`, but {reason}")))
    }

    /// Returns why the run has no such topic.
    fn lacks(&self, topic: PlayedFrom) -> Option<&'static str> {
        match topic {
            PlayedFrom::Rotation if !self.has(StageId::RotationSearch) => {
                Some("with an exhaustive search there is no topic `rotation`")
            }
            PlayedFrom::Refined if !self.has(StageId::Refinement) => {
                Some("without refinement there is no topic `refined`: use `motion`")
            }
            _ => None,
        }
    }

    /// A split run is cut at a topic that it has, and load is shed before the cut.
    fn validate_link(&self) -> Result<(), ConfigurationError> {
        let cut = self.link.cut;
        if self.link.side.is_none() {
            return Ok(());
        }
        let reason = match cut {
            _ if self.source.from != PlayedFrom::Scan => {
                "source.from takes the place of the same stages: remove one of them"
            }
            PlayedFrom::Scan if self.run.mode == Mode::Live => {
                "in mode `live` masking sheds load, and scans that it drops would be sent in vain: cut at `masked` or later"
            }
            _ => match self.lacks(cut) {
                Some(reason) => reason,
                None => return Ok(()),
            },
        };
        let cut = cut.name();
        Err(value("link", format!("cut is `{cut}`, but {reason}")))
    }

    /// A radar waits for nobody, and has an address.
    fn validate_radar(&self) -> Result<(), ConfigurationError> {
        let source = &self.source;
        seconds("source", "silence_s", source.silence_s)?;
        if !self.is_radar() {
            return Ok(());
        }
        let kind = source.kind.name();
        if self.run.mode != Mode::Live {
            let reason =
                format!("kind `{kind}` is a radar, which does not wait: set run.mode to `live`");
            return Err(value("source", reason));
        }
        if self.simulation.is_some() {
            let reason = format!(
                "kind is `{kind}`, but there is a section [simulation]: remove one of them"
            );
            return Err(value("source", reason));
        }
        if source.scans.is_some_and(|scans| scans < 2) {
            let reason = "scans must be 2 or more: a motion is between two";
            return Err(value("source", reason));
        }
        let (given, missing) = match source.kind {
            SourceKind::Ros2 => (
                &source.topic,
                "topic is missing: give that of the driver's azimuths, as in `/radar_data/fft_data`",
            ),
            _ => (
                &source.address,
                "address is missing: give the radar's, as in `192.168.0.1`",
            ),
        };
        if given.is_empty() {
            return Err(value("source", missing));
        }
        match source.kind {
            SourceKind::Ros2 => within("source", Domain::new(source.domain, interface(source))),
            _ => within("source", Address::parse(&source.address, &source.interface)),
        }
    }

    fn validate_record(&self) -> Result<(), ConfigurationError> {
        seconds("record", "split_s", self.record.split_s)
    }

    /// Faults are put into the scans and logs of recordings and simulations.
    fn validate_faults(&self) -> Result<(), ConfigurationError> {
        let source = &self.source;
        if let Some((key, time_s)) = source.faults.iter().find_map(PlayedFault::invalid) {
            let reason = format!("faults has {key} = {time_s}, but must have 0 or more");
            return Err(value("source", reason));
        }
        let plays_scans = !self.is_radar() && source.from == PlayedFrom::Scan;
        if !source.faults.is_empty() && (!plays_scans || self.is_side(Side::Base)) {
            let reason = "faults are put into the scans of a recording or a simulation, which this run does not play: remove them";
            return Err(value("source", reason));
        }
        Ok(())
    }

    fn validate_budget(&self) -> Result<(), ConfigurationError> {
        let limits = |section: String, limits: &Limits| match limits.invalid() {
            Some((key, limit)) => Err(value(
                &section,
                format!("{key} is {limit}, but must be 0 or more"),
            )),
            None => Ok(()),
        };
        limits("budget".to_owned(), &self.budget.all)?;
        let mut scenarios = self.budget.scenarios.iter();
        scenarios.try_for_each(|(name, own)| limits(format!("budget.{name}"), own))
    }

    /// Checks that the run reads the output of the simulation.
    fn validate_simulation(&self) -> Result<(), ConfigurationError> {
        let Some(simulation) = &self.simulation else {
            return Ok(());
        };
        within("simulation", simulation.validate())?;
        let written = simulation.output.format.unwrap_or_default();
        match self.dataset.format {
            Some(read) if OutputFormat::read_as(read) != Some(written) => Err(value(
                "simulation",
                format!(
                    "output.format is {written}, which is not read as dataset.format = \"{read}\""
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Checks that there are points where they are needed.
    fn validate_points(&self) -> Result<(), ConfigurationError> {
        if self.odometry.points.capacity > 0 {
            return Ok(());
        }
        if self.has(StageId::Refinement) {
            let reason = "points.capacity is 0, but a refinement of kind `local-map` matches points: it must be 1 or more";
            return Err(value("points", reason));
        }
        if self.slam.is_on() {
            let reason = "points.capacity is 0, but keyframes of slam are made of points: it must be 1 or more";
            return Err(value("points", reason));
        }
        if self.objects.is_on() {
            let reason =
                "points.capacity is 0, but objects are made of points: it must be 1 or more";
            return Err(value("points", reason));
        }
        Ok(())
    }

    fn validate_times(&self) -> Result<(), ConfigurationError> {
        seconds("run", "stall_timeout_s", self.run.stall_timeout_s)?;
        seconds("run", "start_timeout_s", self.run.start_timeout_s)?;
        seconds("source", "retry_s", self.source.retry_s)?;
        self.stages.iter().try_for_each(|(name, stage)| {
            let section = format!("stages.{name}");
            seconds(&section, "restart.window_s", stage.restart.window_s)
        })
    }
}

fn interface(source: &SourceConfig) -> Option<&str> {
    Some(source.interface.as_str()).filter(|address| !address.is_empty())
}

fn seconds(section: &str, key: &str, seconds: f64) -> Result<(), ConfigurationError> {
    match seconds >= 0.0 && seconds.is_finite() {
        true => Ok(()),
        false => Err(value(
            section,
            format!("{key} is {seconds}, but must be 0 or more"),
        )),
    }
}
