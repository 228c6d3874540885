//! The configuration of a run: read strictly, overridden key by key, written back as it was resolved.

mod automatic;
pub mod difference;
mod error;
mod rate;
pub(crate) mod strict;
mod validation;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_messages::{FollowerId, StageId, Window};
use gyre_odometry::{OdometryConfig, SearchKind};
use gyre_radar::DatasetOptions;
use gyre_radar_replay::{PlayedFrom, SourceConfig, SourceKind};
use gyre_scan_matching::RefinementKind;
use gyre_simulator::{OutputFormat, SimulationConfig};
use gyre_slam::SlamConfig;
use gyre_stage::supervise::{Program, RestartPolicy, Scheduling, StagePlan};
use gyre_stress::{Budget, Scenario};
use serde::{Deserialize, Serialize};

use crate::record::RecordConfig;

pub use error::ConfigurationError;
pub use rate::Rate;

/// The configuration of a run. Every key has a default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Configuration {
    /// The mode and pace of the run.
    pub run: RunConfig,
    /// The recording to play.
    pub source: SourceConfig,
    /// The format of the recording and the constants of its radar. A key that is left out is taken
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
    /// What `gyre stress` asks of a run: limits for all scenarios, and in `[budget.NAME]` for one of them.
    /// A scenario whose purpose is a fault (`slow-stage`, `stopped`, `kills`) is judged by `recovery_ms` and by
    /// its own limits alone, and `bursts` by drops only if it names them. A run itself does not depend on it.
    pub budget: Budget,
    /// The recording of the run as MCAP. Results do not depend on it.
    pub record: RecordConfig,
    /// The command and the restarts of a stage: `radar-replay`, `masking`, `rotation-search`,
    /// `translation-search`, `joint-search`, `refinement`, `pose-integration`, `loop-closure`,
    /// `trajectory` or `localisation`.
    pub stages: BTreeMap<String, StageConfig>,
}

/// The section `[run]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RunConfig {
    /// `lossless`: every scan is processed, and the source waits. `live`: the newest scan wins.
    pub mode: Mode,
    /// Maximum number of scans between admission and their pose, 1 to 64. More than the free cores
    /// increases latency and not throughput.
    pub window: usize,
    /// Pace of the source: `max`, `realtime`, or a factor of real time from 0.001 to 1000. Live mode
    /// needs another than `max`.
    pub rate: Rate,
    /// Room for programs that look on, 0 to 64 of each topic: `gyre watch`, a viewer, a recorder. They
    /// change neither a result nor a latency. Each needs shared memory for one message of each topic.
    pub observers: usize,
    /// Time for which a published scan may lack its pose, or the source a scan that is due, s; 0: no
    /// limit. Then stages are restarted: first the source if it is late, else all but a live source;
    /// if that does not help, all; if that does not help either, the run ends. With SLAM also the time
    /// in which a follower that the run waits for at its end must make progress; else it is restarted.
    pub stall_timeout_s: f64,
    /// Time for a stage to open its topics after its start, s; 0: no limit. A stage that takes longer,
    /// as one that cannot load its model, is treated as a stall.
    pub start_timeout_s: f64,
    /// How the system runs the stages: priority, processors, memory. Followers have their own alone.
    #[serde(skip_serializing_if = "is_default")]
    pub scheduling: Scheduling,
    /// Ground truth for the evaluation. Default: the one in the recording's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground_truth: Option<PathBuf>,
}

/// The policy when scans arrive faster than they can be processed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// The source waits.
    Lossless,
    /// The newest scan wins.
    Live,
}

/// A section `[stages.NAME]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StageConfig {
    /// Program and arguments of a replacement. Default: `gyre stage NAME`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub command: Vec<String>,
    /// Limits of its restarts.
    pub restart: RestartPolicy,
    /// How the system runs it: its keys go before those of `run.scheduling`.
    #[serde(skip_serializing_if = "is_default")]
    pub scheduling: Scheduling,
    /// Delay for each scan, ms, to test behaviour under load. Source and `pose-integration` have none.
    #[serde(skip_serializing_if = "is_zero")]
    pub delay_ms: u64,
}

fn is_default(scheduling: &Scheduling) -> bool {
    *scheduling == Scheduling::default()
}

fn is_zero(value: &u64) -> bool {
    *value == 0
}

impl Default for RunConfig {
    fn default() -> Self {
        Self {
            mode: Mode::Lossless,
            window: 4,
            rate: Rate::Max,
            observers: 8,
            stall_timeout_s: 60.0,
            start_timeout_s: 300.0,
            scheduling: Scheduling::default(),
            ground_truth: None,
        }
    }
}

impl Configuration {
    /// Reads a configuration and overrides keys of it with `section.key=value`.
    ///
    /// # Errors
    /// A file that cannot be read, an unknown key, a value out of its bounds.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, ConfigurationError> {
        let unreadable = |source| ConfigurationError::Unreadable {
            path: path.to_owned(),
            source,
        };
        let text = gyre_storage::read_text(path, gyre_storage::SETTINGS).map_err(unreadable)?;
        let parsed: Result<toml::Table, _> = text.parse();
        let table = parsed.map_err(|error| ConfigurationError::Syntax {
            path: path.to_owned(),
            reason: syntax(&text, &error),
        })?;
        Self::resolve(table, overrides)
    }

    /// Creates a configuration from overrides `section.key=value` alone.
    ///
    /// # Errors
    /// An unknown key, a value out of its bounds.
    pub fn of_overrides(overrides: &[String]) -> Result<Self, ConfigurationError> {
        Self::resolve(toml::Table::new(), overrides)
    }

    fn resolve(mut table: toml::Table, overrides: &[String]) -> Result<Self, ConfigurationError> {
        for sentence in overrides {
            strict::set(&mut table, sentence)?;
        }
        let configuration = Self::from_table(table)?;
        configuration.validate()?;
        Ok(configuration)
    }

    fn from_table(mut table: toml::Table) -> Result<Self, ConfigurationError> {
        let mut configuration = Self {
            run: strict::section(&mut table, "run")?,
            source: strict::section(&mut table, "source")?,
            dataset: strict::section(&mut table, "dataset")?,
            simulation: match table.contains_key("simulation") {
                true => Some(strict::section(&mut table, "simulation")?),
                false => None,
            },
            odometry: OdometryConfig {
                raster: strict::section(&mut table, "raster")?,
                points: strict::section(&mut table, "points")?,
                masking: strict::section(&mut table, "masking")?,
                search: strict::section(&mut table, "search")?,
                rotation: strict::section(&mut table, "rotation")?,
                translation: strict::section(&mut table, "translation")?,
                exhaustive: strict::section(&mut table, "exhaustive")?,
                refinement: strict::section(&mut table, "refinement")?,
            },
            slam: strict::section(&mut table, "slam")?,
            budget: budget(&mut table)?,
            record: strict::section(&mut table, "record")?,
            stages: strict::sections(&mut table, "stages", &process_names())?,
        };
        let format = configuration.dataset.format.and_then(OutputFormat::read_as);
        if let Some(simulation) = &mut configuration.simulation {
            simulation.output.format = simulation.output.format.or(format);
        }
        let known = [
            "run",
            "source",
            "dataset",
            "simulation",
            "raster",
            "points",
            "masking",
            "search",
            "rotation",
            "translation",
            "exhaustive",
            "refinement",
            "slam",
            "budget",
            "record",
            "stages",
        ];
        match table.keys().next() {
            None => Ok(configuration),
            Some(key) => Err(strict::unknown("the configuration", key, &known)),
        }
    }

    /// Returns the limits on scans in flight, with masks that look at `scans_a_mask` scans. In live mode the source keeps what
    /// arrives within a second, the time of a restart.
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
            slam: self.slam.is_on(),
            localises: self.slam.is_localised(),
        }
    }

    /// Returns whether the scans are those of a radar on the network.
    pub fn is_radar(&self) -> bool {
        self.source.kind == SourceKind::Colossus
    }

    /// Returns the simulation, if it is played without being stored.
    pub fn streamed(&self) -> Option<&SimulationConfig> {
        self.simulation
            .as_ref()
            .filter(|simulation| !simulation.output.store)
    }

    /// Returns the simulation, if it is stored and then played as a recording.
    pub fn stored(&self) -> Option<&SimulationConfig> {
        self.simulation
            .as_ref()
            .filter(|simulation| simulation.output.store)
    }

    /// Plays this recording instead, or streams the simulation even if a run would store it: for commands that read the scans
    /// without a run. Streamed and stored scans are byte-identical.
    #[must_use]
    pub fn streaming(mut self, data: Option<&Path>) -> Self {
        if let Some(data) = data {
            self.simulation = None;
            self.source.kind = SourceKind::Recording;
            self.source.data = data.to_owned();
        }
        if let Some(simulation) = &mut self.simulation {
            simulation.output.store = false;
            self.dataset = self.dataset.or(&simulation.dataset_options());
        }
        self
    }

    /// Returns the recording's folder, the radar, or `a simulation`.
    pub fn data(&self) -> String {
        if self.is_radar() {
            return format!("the radar at {}", self.source.address);
        }
        match self.streamed() {
            Some(_) => "a simulation".to_owned(),
            None => self.source.data.display().to_string(),
        }
    }

    /// Returns whether the run has this stage.
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

    /// Returns whether the run starts this stage: it has it, and a recording does not take its place.
    pub fn starts(&self, stage: StageId) -> bool {
        let computes = match stage {
            StageId::RadarReplay | StageId::PoseIntegration => None,
            StageId::Masking => Some(PlayedFrom::Masked),
            StageId::RotationSearch => Some(PlayedFrom::Rotation),
            StageId::TranslationSearch | StageId::JointSearch => Some(PlayedFrom::Motion),
            StageId::Refinement => Some(PlayedFrom::Refined),
        };
        // The topics are in the order of the stream.
        self.has(stage) && computes.is_none_or(|topic| topic as u8 > self.source.from as u8)
    }

    /// Returns the processes to start: `gyre stage NAME`, or their replacements.
    pub fn stage_plans(&self, gyre: &Path) -> Vec<StagePlan> {
        let live = self.run.mode == Mode::Live;
        let plan = |name: &str| {
            let own = self.stages.get(name).cloned().unwrap_or_default();
            let ours = || {
                vec![
                    gyre.to_string_lossy().into_owned(),
                    "stage".to_owned(),
                    name.to_owned(),
                ]
            };
            // The supervisor keeps its own program; those of others can change under their names.
            let (command, programs) = match own.command.is_empty() {
                true => (ours(), Vec::new()),
                false => (own.command.clone(), Program::all_of(&own.command, None)),
            };
            let scheduling = match FollowerId::by_name(name) {
                Some(_) => own.scheduling,
                None => own.scheduling.or(&self.run.scheduling),
            };
            StagePlan {
                name: name.to_owned(),
                command,
                programs,
                directory: None,
                scheduling,
                restart: own.restart,
                outlives_restarts: live && name == StageId::RadarReplay.name(),
                // Live masking alone knows which scans it admitted.
                restarts_all: live && name == StageId::Masking.name(),
            }
        };
        let stages = StageId::ALL.into_iter().filter(|stage| self.starts(*stage));
        let window = self.window(None, 1);
        let followers = FollowerId::ALL.into_iter().filter(|it| it.is_in(&window));
        let followers = followers.map(FollowerId::name);
        stages
            .map(StageId::name)
            .chain(followers)
            .map(plan)
            .collect()
    }

    /// Returns the resolved configuration as TOML: a run from it repeats this run.
    ///
    /// # Errors
    /// A value that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string_pretty(self)
    }

    /// Returns the first key in which this configuration differs from `begun`, of those that the result depends on. `None`: a run
    /// that was begun with it can be resumed with this.
    ///
    /// # Errors
    /// A value that TOML cannot hold.
    pub fn difference(&self, begun: &toml::Table) -> Result<Option<String>, crate::Failure> {
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
            ] {
                if let Some(section) = table.get_mut(section).and_then(|key| key.as_table_mut()) {
                    section.retain(|key, _| keys.contains(&key));
                }
            }
            table
        };
        // Through text, as `begun` came: a table made directly has other digits in its f32 values.
        let now: toml::Table = self.to_toml()?.parse()?;
        Ok(difference::first(&relevant(begun), &relevant(&now)))
    }
}

/// Reads the limits for all scenarios, and those for each.
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

/// Returns the names of all processes that a run can have.
pub fn process_names() -> Vec<&'static str> {
    let followers = FollowerId::ALL.map(FollowerId::name);
    StageId::ALL
        .map(StageId::name)
        .into_iter()
        .chain(followers)
        .collect()
}

/// Names the place of a mistake, without the line itself: the file may hold anything.
pub(crate) fn syntax(text: &str, error: &toml::de::Error) -> String {
    let start = error.span().map_or(0, |span| span.start);
    let before = text.get(..start).unwrap_or_default();
    let (line, column) = match before.rsplit_once('\n') {
        Some((lines, row)) => (lines.matches('\n').count() + 2, row.chars().count() + 1),
        None => (1, before.chars().count() + 1),
    };
    let reason = error.message().trim().replace('\n', "; ");
    format!("TOML parse error at line {line}, column {column}: {reason}")
}

#[cfg(test)]
mod tests;
