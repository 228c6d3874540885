//! The configuration of a run: read strictly, overridden key by key, written back as it was
//! resolved.

pub mod difference;
mod validation;
mod without_effect;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_contract::{
    FollowerId, StageId, StageTopics, Window,
    run::{
        Budget, LinkConfig, Mode, PlayedFrom, RecordConfig, RunConfig, Scenario, Side,
        SourceConfig, SourceKind, StageConfig,
    },
};
use gyre_datasets::DatasetOptions;
use gyre_geometry::samples::GnssConfig;
use gyre_masking::MaskKind;
use gyre_matching::{
    RefinementKind,
    odometry::{OdometryConfig, SearchKind},
};
use gyre_objects::ObjectsConfig;
use gyre_simulator::{OutputFormat, SimulationConfig};
use gyre_slam::SlamConfig;
use serde::Serialize;

use crate::{
    ConfigurationError,
    automatic::{AutomaticError, automatic},
    method::MethodConfig,
    paths::{self, Named},
    strict,
};

/// The configuration of a run. Every key has a default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Configuration {
    /// The mode and pace of the run.
    pub run: RunConfig,
    /// The recording to play.
    pub source: SourceConfig,
    /// The format of the recording and the constants of its radar. A key that is left out comes
    /// from the recording's `dataset.toml`, else from the format.
    pub dataset: DatasetOptions,
    /// A drive to simulate and play, instead of `source.data`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulation: Option<SimulationConfig>,
    /// The settings of the method: the sections from `raster` to `refinement`.
    #[serde(flatten)]
    pub odometry: OdometryConfig,
    /// The correction of the trajectory at places that are seen again.
    pub slam: SlamConfig,
    /// The fixes of GNSS that the corrected trajectory is made with. Odometry does not depend on
    /// them.
    pub gnss: GnssConfig,
    /// The tracking of moving objects.
    pub objects: ObjectsConfig,
    /// The limits that `gyre stress` checks: limits for all scenarios, and in `[budget.NAME]` for
    /// one of them. A scenario whose purpose is a fault (`slow-stage`, `stopped`, `kills`) is
    /// judged by `recovery_ms` and by its own limits alone, and `bursts` by drops only if it names
    /// them. A run itself does not depend on it.
    pub budget: Budget,
    /// The recording of the run as MCAP. Results do not depend on it.
    pub record: RecordConfig,
    /// A run that is split between two machines.
    #[serde(skip_serializing_if = "is_whole")]
    pub link: LinkConfig,
    /// The command and the restarts of a stage: `radar-replay`, `masking`, `rotation-search`,
    /// `translation-search`, `joint-search`, `refinement`, `pose-integration`, `loop-closure`,
    /// `trajectory`, `localisation` or `objects`.
    pub stages: BTreeMap<String, StageConfig>,
}

fn is_whole(link: &LinkConfig) -> bool {
    *link == LinkConfig::default()
}

impl Configuration {
    /// Reads a configuration and overrides keys of it with `section.key=value`.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, ConfigurationError> {
        Self::resolve(Named::read_in(path, None)?.table, overrides)
    }

    /// As [`read`](Self::read), of a path or of the name of a configuration of the program, for a
    /// person. Returns sentences about its paths too.
    pub fn named(
        path: &Path,
        overrides: &[String],
    ) -> Result<(Self, Vec<String>), ConfigurationError> {
        let named = Named::read(path)?;
        let mut changed = named.table.clone();
        set_all(&mut changed, overrides)?;
        let notes = named.notes(&changed);
        Ok((Self::of_table(changed)?, notes))
    }

    /// Creates a configuration from overrides `section.key=value` alone.
    pub fn of_overrides(overrides: &[String]) -> Result<Self, ConfigurationError> {
        Self::resolve(toml::Table::new(), overrides)
    }

    /// Creates the configuration of a recording from its format, its `dataset.toml` and its scans.
    /// Returns a sentence about it too.
    pub fn of_recording(
        data: &Path,
        overrides: &[String],
    ) -> Result<(Self, String), AutomaticError> {
        let wished = Self::of_overrides(overrides)?.dataset;
        let found = automatic(data, &wished)?;
        Ok((Self::resolve(found.table, overrides)?, found.sentence))
    }

    fn resolve(mut table: toml::Table, overrides: &[String]) -> Result<Self, ConfigurationError> {
        set_all(&mut table, overrides)?;
        Self::of_table(table)
    }

    fn of_table(mut table: toml::Table) -> Result<Self, ConfigurationError> {
        paths::resolve(&mut table)?;
        let configuration = Self::from_table(table)?;
        configuration.validate()?;
        Ok(configuration)
    }

    fn from_table(mut table: toml::Table) -> Result<Self, ConfigurationError> {
        let method = MethodConfig::take(&mut table)?;
        let mut configuration = Self {
            run: strict::section(&mut table, "run")?,
            source: strict::section(&mut table, "source")?,
            dataset: method.dataset,
            simulation: match table.contains_key("simulation") {
                true => Some(strict::section(&mut table, "simulation")?),
                false => None,
            },
            odometry: method.odometry,
            slam: method.slam,
            gnss: method.gnss,
            objects: method.objects,
            budget: budget(&mut table)?,
            record: strict::section(&mut table, "record")?,
            link: strict::section(&mut table, "link")?,
            stages: strict::sections(&mut table, "stages", &process_names())?,
        };
        let format = configuration.dataset.format.and_then(OutputFormat::read_as);
        if let Some(simulation) = &mut configuration.simulation {
            simulation.output.format = simulation.output.format.or(format);
        }
        configuration.leave_masks_to_python();
        let known = [
            &MethodConfig::SECTIONS_OF_A_RUN[..],
            &MethodConfig::sections(),
        ]
        .concat();
        match table.keys().next() {
            None => Ok(configuration),
            Some(key) => Err(strict::unknown("the configuration", key, &known)),
        }
    }

    /// A mask that is a function of Python takes the place of a network, which is not loaded then.
    fn leave_masks_to_python(&mut self) {
        let masking = self.stages.get(StageId::Masking.name());
        let is_python = masking.is_some_and(|stage| stage.python.is_some());
        if is_python && self.odometry.masking.kind == MaskKind::Learned {
            self.odometry.masking.kind = MaskKind::Threshold;
        }
    }

    /// Returns the limits on scans in flight, with masks that look at `scans_a_mask` scans. In live
    /// mode the source keeps what arrives within a second, the time of a restart.
    pub fn window(&self, period: Option<Duration>, scans_a_mask: usize) -> Window {
        let pace = match self.is_radar() {
            true => Some(1.0),
            false => self.run.rate.factor(),
        };
        let live_depth = match (self.run.mode, pace) {
            (Mode::Live, Some(rate)) => {
                let period_s = period.map_or(0.25, |period| period.as_secs_f64()) / rate;
                (1.0 / period_s.max(0.01)).ceil() as usize + self.run.window + 1
            }
            _ => 0,
        };
        Window {
            scans: self.run.window,
            lag: self.odometry.masking.feedback_lag(),
            look_back: scans_a_mask,
            live_depth,
            observers: self.run.observers,
            slam: self.slam.is_on() || self.link.keyframes,
            localises: self.slam.is_localised(),
            objects: self.objects.is_on(),
        }
    }

    pub fn is_radar(&self) -> bool {
        self.source.kind != SourceKind::Recording
    }

    pub fn is_side(&self, side: Side) -> bool {
        self.link.side == Some(side)
    }

    /// Removes the sections of the other side: the robot has no SLAM, and the base has no scans of
    /// its own.
    pub fn leave_other_side(&mut self) {
        match self.link.side {
            Some(Side::Robot) => {
                self.link.keyframes |= self.slam.is_on();
                self.slam = SlamConfig::default();
                self.gnss = GnssConfig::default();
            }
            Some(Side::Base) => {
                self.simulation = None;
                self.source.kind = SourceKind::Recording;
                self.source.data = PathBuf::new();
            }
            None => {}
        }
    }

    pub fn is_link(&self, stage: &str) -> bool {
        let place = match self.link.side {
            Some(Side::Robot) => StageId::PoseIntegration,
            Some(Side::Base) => StageId::RadarReplay,
            None => return false,
        };
        place.name() == stage
    }

    /// Plays this recording instead, or the simulation with the constants of its radar: for
    /// commands that read the scans without a run.
    #[must_use]
    pub fn streaming(mut self, data: Option<&Path>) -> Self {
        if let Some(data) = data {
            self.simulation = None;
            self.source.kind = SourceKind::Recording;
            self.source.data = data.to_owned();
        }
        if let Some(simulation) = &self.simulation {
            self.dataset = self.dataset.or(&simulation.dataset_options());
        }
        self
    }

    /// Returns the recording's folder, the radar, or `a simulation`.
    pub fn data(&self) -> String {
        match self.source.kind {
            SourceKind::Colossus => return format!("the radar at {}", self.source.address),
            SourceKind::Ros2 => return format!("the radar on {}", self.source.topic),
            SourceKind::Recording => {}
        }
        if self.is_side(Side::Base) {
            return format!("the robot on the link {}", self.link.name);
        }
        match &self.simulation {
            Some(_) => "a simulation".to_owned(),
            None => self.source.data.display().to_string(),
        }
    }

    pub fn has(&self, stage: StageId) -> bool {
        match stage {
            StageId::RotationSearch | StageId::TranslationSearch => {
                self.odometry.search.kind == SearchKind::Decoupled
            }
            StageId::JointSearch => self.odometry.search.kind == SearchKind::Exhaustive,
            StageId::Refinement => self.odometry.refinement.kind == RefinementKind::LocalMap,
            StageId::RadarReplay | StageId::Masking | StageId::PoseIntegration => true,
        }
    }

    /// Chooses the search or the refinement that consists of this stage, so that the run has it.
    pub fn choose(&mut self, stage: StageId) {
        let method = &mut self.odometry;
        match stage {
            StageId::JointSearch => method.search.kind = SearchKind::Exhaustive,
            StageId::RotationSearch | StageId::TranslationSearch => {
                method.search.kind = SearchKind::Decoupled;
            }
            StageId::Refinement => method.refinement.kind = RefinementKind::LocalMap,
            StageId::RadarReplay | StageId::Masking | StageId::PoseIntegration => {}
        }
    }

    /// Returns whether the run starts this stage: it has it, and neither a recording nor the other
    /// side of a link takes its place.
    pub fn starts(&self, stage: StageId) -> bool {
        let topics = StageTopics::of(stage, &self.window(None, 1), self.has(StageId::Refinement));
        let computes = PlayedFrom::by_name(topics.output).filter(|it| *it != PlayedFrom::Scan);
        // The topics are in the order of the stream.
        let is_here = |topic: PlayedFrom| match self.link.side {
            Some(Side::Robot) => topic as u8 <= self.link.cut as u8,
            Some(Side::Base) => topic as u8 > self.link.cut as u8,
            None => topic as u8 > self.source.from as u8,
        };
        self.has(stage) && computes.is_none_or(is_here)
    }

    /// Returns whether no side of the run starts this stage.
    fn is_absent(&self, stage: StageId) -> bool {
        match self.link.side {
            Some(_) => !self.has(stage),
            None => !self.starts(stage),
        }
    }

    /// Returns the resolved configuration as TOML: a run from it repeats this run.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string_pretty(self)
    }

    /// Returns the first result-relevant key that differs between this configuration and `begun`.
    /// `None`: a run that was begun with it can be resumed with this.
    pub fn difference(&self, begun: &toml::Table) -> Result<Option<String>, toml::ser::Error> {
        let relevant = |table: &toml::Table| {
            let mut table = table.clone();
            table.remove("stages");
            table.remove("budget");
            table.remove("record");
            for (section, keys) in [
                ("run", &["mode"][..]),
                (
                    "source",
                    &[
                        "kind", "address", "data", "from", "first", "scans", "repeat",
                    ],
                ),
                ("link", &["side", "cut", "keyframes"]),
            ] {
                if let Some(section) = table.get_mut(section).and_then(|key| key.as_table_mut()) {
                    section.retain(|key, _| keys.contains(&key));
                }
            }
            table
        };
        // Through text, as `begun` came: a table made directly has other digits in its f32 values.
        let unparsed =
            |error: toml::de::Error| <toml::ser::Error as serde::ser::Error>::custom(error);
        let now: toml::Table = self.to_toml()?.parse().map_err(unparsed)?;
        Ok(difference::first(&relevant(begun), &relevant(&now)))
    }
}

fn set_all(table: &mut toml::Table, overrides: &[String]) -> Result<(), ConfigurationError> {
    let mut overrides = overrides.iter();
    overrides.try_for_each(|sentence| strict::set(table, sentence))
}

fn budget(table: &mut toml::Table) -> Result<Budget, ConfigurationError> {
    let mut scenarios = toml::Table::new();
    if let Some(toml::Value::Table(budget)) = table.get_mut("budget") {
        let names: Vec<String> = budget
            .iter()
            .filter(|(_, value)| value.is_table())
            .map(|(name, _)| name.clone())
            .collect();
        for name in names {
            scenarios.extend(budget.remove_entry(&name));
        }
    }
    let known = Scenario::ALL.map(Scenario::name);
    let mut scenarios = toml::Table::from_iter([("budget".to_owned(), scenarios.into())]);
    Ok(Budget {
        scenarios: strict::sections(&mut scenarios, "budget", &known)?,
        all: strict::section(table, "budget")?,
    })
}

pub fn process_names() -> Vec<&'static str> {
    let followers = FollowerId::ALL.map(FollowerId::name);
    StageId::ALL
        .map(StageId::name)
        .into_iter()
        .chain(followers)
        .collect()
}

#[cfg(test)]
mod tests;
