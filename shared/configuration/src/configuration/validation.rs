//! The bounds of all values, and the sections that must fit each other.

use std::collections::BTreeMap;

use gyre_colossus::Address;
use gyre_contract::{
    StageId,
    run::{Mode, PlayedFrom, Rate, Side, SourceKind, StageConfig},
};
use gyre_geometry::samples::{SensorConfig, SensorKind};
use gyre_ros2_messages::Domain;
use gyre_simulator::OutputFormat;
use gyre_slam::SlamKind;

use super::Configuration;
use crate::{
    ConfigurationError,
    method::MethodConfig,
    strict::{value, within},
};

macro_rules! refuse {
    ($($section:literal if $contradicts:expr => $reason:literal;)*) => {
        $(if $contradicts {
            return Err(value($section, format_args!($reason)));
        })*
    };
}

impl Configuration {
    pub(super) fn validate(&self) -> Result<(), ConfigurationError> {
        MethodConfig::check(&self.odometry, &self.gnss)?;
        within("run", self.window(None, 1).validate())?;
        if let Some(simulation) = &self.simulation {
            within("simulation", simulation.validate())?;
        }
        self.validate_numbers()?;
        within("run", self.run.scheduling.validate())?;
        self.validate_stages()?;
        self.validate_method()?;
        self.validate_sensors()?;
        self.validate_source()?;
        self.validate_parts()
    }

    fn validate_numbers(&self) -> Result<(), ConfigurationError> {
        let (run, source) = (&self.run, &self.source);
        for (section, key, number) in [
            ("run", "stall_timeout_s", run.stall_timeout_s),
            ("run", "start_timeout_s", run.start_timeout_s),
            ("source", "retry_s", source.retry_s),
            ("source", "silence_s", source.silence_s),
            ("record", "split_s", self.record.split_s),
            ("record", "keep_s", self.record.keep_s),
        ] {
            let is_valid = number >= 0.0 && number.is_finite();
            if !is_valid {
                let reason = format!("{key} is {number}, but must be 0 or more");
                return Err(value(section, reason));
            }
        }
        if self.record.keeps_whole() {
            let reason = "keep_mb and keep_s remove whole files: set split_mb or split_s too";
            return Err(value("record", reason.to_owned()));
        }
        let of_all = ("budget".to_owned(), &self.budget.all);
        let scenarios = self.budget.scenarios.iter();
        let each = scenarios.map(|(name, own)| (format!("budget.{name}"), own));
        for (section, limits) in std::iter::once(of_all).chain(each) {
            if let Some((key, limit)) = limits.invalid() {
                let reason = format!("{key} is {limit}, but must be 0 or more");
                return Err(value(&section, reason));
            }
        }
        Ok(())
    }

    fn validate_stages(&self) -> Result<(), ConfigurationError> {
        for (name, stage) in &self.stages {
            let section = format!("stages.{name}");
            within(&section, stage.scheduling.validate())?;
            if stage.python.is_none() {
                continue;
            }
            let is_absent = StageId::by_name(name).is_some_and(|stage| self.is_absent(stage));
            let reason = match StageConfig::function(name) {
                _ if !stage.command.is_empty() => {
                    "command and python are both set, but one program takes the place of the stage: remove one of them".to_owned()
                }
                Err(reason) => format!("python is set, but {reason}"),
                Ok(_) if is_absent => {
                    "python is set, but this run has no such stage: see search.kind and source.from".to_owned()
                }
                Ok(_) => continue,
            };
            return Err(value(&section, reason));
        }
        Ok(())
    }

    /// There are points where they are needed, and fixes are constraints of a graph. The fixes of a
    /// recording are in a log. Those beside a live radar arrive during the run, or are in a log
    /// that is complete when it begins.
    fn validate_method(&self) -> Result<(), ConfigurationError> {
        let (odometry, slam, gnss) = (&self.odometry, &self.slam, &self.gnss);
        let has_points = odometry.points.capacity > 0;
        refuse! {
            "points" if !has_points && self.has(StageId::Refinement) =>
                "points.capacity is 0, but a refinement of kind `local-map` matches points: it must be 1 or more";
            "points" if !has_points && slam.is_on() =>
                "points.capacity is 0, but keyframes of slam are made of points: it must be 1 or more";
            "points" if !has_points && self.objects.is_on() =>
                "points.capacity is 0, but objects are made of points: it must be 1 or more";
            "slam" if !(0.0..=50.0).contains(&slam.submap_reach_m) =>
                "submap_reach_m is out of its bounds: expected 0 to 50 m";
            "slam" if !slam.is_on() && !slam.map.as_os_str().is_empty() =>
                "map is set, but slam makes the keyframes that are found in it: set kind to `graph`";
            "gnss" if gnss.kind != SensorKind::None && slam.kind != SlamKind::Graph =>
                "kind is set, but fixes are constraints of the graph of slam: set slam.kind to `graph`";
            "gnss" if gnss.kind == SensorKind::Auto && self.is_radar() =>
                "kind is `auto`, but the log of a live radar does not lie beside its scans: receive fixes with kind = \"udp\" or \"ros2\", or name a log with kind = \"log\" and file";
            "gnss" if gnss.kind == SensorKind::Udp && !self.is_radar() && !self.is_side(Side::Base) =>
                "kind is `udp`, but the scans are of no live radar: set kind to `auto`, or name a log with kind = \"log\" and file";
            "gnss" if gnss.kind == SensorKind::Ros2 && self.source.kind != SourceKind::Ros2 =>
                "kind is `ros2`, but the radar is not behind its driver in ROS 2: receive fixes with kind = \"udp\", or name a log with kind = \"log\" and file";
            "objects" if self.objects.is_on() && self.link.side.is_some() =>
                "kind is `tracks`, but a run that is split between two machines (link.side) logs no points: set kind to `none`";
        }
        Ok(())
    }

    /// The sensors beside the radar.
    pub fn sensors(&self) -> Vec<&dyn SensorConfig> {
        let mut sensors = self.odometry.sensors.sampled();
        sensors.push(&self.gnss);
        sensors
    }

    /// A log that is used is named, messages of ROS 2 are of a kind that they have, and no two live
    /// sensors have one address.
    fn validate_sensors(&self) -> Result<(), ConfigurationError> {
        let mut taken = BTreeMap::new();
        for sensor in self.sensors() {
            let (section, listen) = (sensor.of().section(), sensor.listen());
            let is_named = !sensor.file().as_os_str().is_empty();
            if sensor.kind() == SensorKind::Log && !is_named {
                let reason = "kind is `log`, but no file is named: set file, or kind to `auto`";
                return Err(value(section, reason));
            }
            if sensor.kind() == SensorKind::Ros2 && sensor.live_topic().is_none() {
                let reason = "kind is `ros2`, but no message of ROS 2 has its samples: receive them with kind = \"udp\"";
                return Err(value(section, reason));
            }
            let before = sensor.receives().then(|| taken.insert(listen, section));
            if let Some(other) = before.flatten() {
                let reason = format!("listen is {listen}, as that of {other}: set another port");
                return Err(value(section, reason));
            }
        }
        Ok(())
    }

    /// A radar waits for nobody, and has an address. A run reads the output of its simulation.
    fn validate_source(&self) -> Result<(), ConfigurationError> {
        let (run, source) = (&self.run, &self.source);
        let (is_radar, is_live, kind) =
            (self.is_radar(), run.mode == Mode::Live, source.kind.name());
        let has_scans = !is_radar && !self.is_side(Side::Base);
        refuse! {
            "source" if is_radar && !is_live =>
                "kind `{kind}` is a radar, which does not wait: set run.mode to `live`";
            "source" if is_radar && self.simulation.is_some() =>
                "kind is `{kind}`, but there is a section [simulation]: remove one of them";
            "source" if is_radar && source.scans.is_some_and(|scans| scans < 2) =>
                "scans must be 2 or more: a motion is between two";
            "source" if source.kind == SourceKind::Ros2 && source.topic.is_empty() =>
                "topic is missing: give the topic of the driver's azimuths, as in `/radar_data/fft_data`";
            "source" if source.kind == SourceKind::Colossus && source.address.is_empty() =>
                "address is missing: give the radar's, as in `192.168.0.1`";
            "source" if source.burst.get() > 1 && run.rate == Rate::Max =>
                "burst needs a pace: set run.rate to `realtime` or a factor";
            "source" if source.commands.is_some() && source.from != PlayedFrom::Scan =>
                "commands need masking, whose place `from` takes: remove one of them";
            "run" if !(0.0..=200.0).contains(&run.predict_hz) =>
                "predict_hz must be 0 to 200";
            "run" if run.predict_hz > 0.0 && !is_radar =>
                "predict_hz is for the poses between the scans of a live radar (source.kind), which this run does not have";
            "run" if is_live && run.rate == Rate::Max && has_scans =>
                "mode `live` needs a radar's pace: set rate to `realtime` or a factor";
        }
        match source.kind {
            SourceKind::Ros2 => {
                let interface = Some(source.interface.as_str()).filter(|it| !it.is_empty());
                within("source", Domain::new(source.domain, interface))?;
            }
            SourceKind::Colossus => {
                within("source", Address::parse(&source.address, &source.interface))?;
            }
            SourceKind::Recording => {}
        }
        let written = self.simulation.as_ref();
        let written = written.map(|it| it.output.format.unwrap_or_default());
        match (written, self.dataset.format) {
            (Some(written), Some(read)) if OutputFormat::read_as(read) != Some(written) => {
                let reason = format!(
                    "output.format is {written}, which is not read as dataset.format = \"{read}\""
                );
                Err(value("simulation", reason))
            }
            _ => Ok(()),
        }
    }

    /// A recording that takes the place of stages is a recording of a run, and has the topic of a
    /// stage that the run has. A split run is cut at a topic that it has, and load is shed before
    /// the cut.
    fn validate_parts(&self) -> Result<(), ConfigurationError> {
        let (source, is_live) = (&self.source, self.run.mode == Mode::Live);
        let (plays_messages, is_split) =
            (source.from != PlayedFrom::Scan, self.link.side.is_some());
        let (from, cut) = (source.from.name(), self.link.cut.name());
        let lacks = |topic| self.lacks(topic).unwrap_or_default();
        let (lacks_from, lacks_cut) = (lacks(source.from), lacks(self.link.cut));
        refuse! {
            "link" if is_split && plays_messages =>
                "cut is `{cut}`, but source.from takes the place of the same stages: remove one of them";
            "link" if is_split && is_live && self.link.cut == PlayedFrom::Scan =>
                "cut is `{cut}`, but in mode `live` masking sheds load, and scans that it drops would be sent in vain: cut at `masked` or later";
            "link" if is_split && !lacks_cut.is_empty() =>
                "cut is `{cut}`, but {lacks_cut}";
            "source" if plays_messages && is_live =>
                "from is `{from}`, but in mode `live` nothing but scans can be played";
            "source" if plays_messages && source.first > 0 =>
                "from is `{from}`, but first must be 0: the stages need all messages before";
            "source" if plays_messages && !lacks_from.is_empty() =>
                "from is `{from}`, but {lacks_from}";
        }
        Ok(())
    }

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
}
