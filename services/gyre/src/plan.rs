//! The processes of a run: `gyre stage NAME` or their replacements, and the recorder.
//!
//! A stage that is started again must be the program that it was. Gyre's own stages are started
//! from the file that the supervisor executes, which stays while it runs, even if another build
//! takes its name.

use std::{collections::BTreeMap, io, path::Path};

use blake3::Hasher;
use gyre_configuration::{
    Configuration,
    terminal::{Failure, own},
};
use gyre_contract::{
    FollowerId, StageId,
    run::{LinkConfig, Mode, RecordConfig, Side, StageConfig},
};
use gyre_results::Programs;
use gyre_supervise::{END_TIMEOUT, Program, StagePlan};

pub fn stage_plans(configuration: &Configuration, gyre: &Path) -> Vec<StagePlan> {
    let live = configuration.run.mode == Mode::Live;
    let plan = |name: &str| {
        let own = configuration.stages.get(name).cloned().unwrap_or_default();
        let is_link = configuration.is_link(name);
        let is_base = configuration.is_side(Side::Base) && is_link;
        let gyre = gyre.to_string_lossy();
        // The supervisor keeps its own program open; programs of others can change under their
        // names.
        let (command, programs) = match is_link {
            true => (StageConfig::own_command(&gyre, name, None), Vec::new()),
            false => (
                own.command(&gyre, name),
                Program::all_of(&own.replacement(), None),
            ),
        };
        let scheduling = match FollowerId::by_name(name) {
            Some(_) => own.scheduling,
            None => own.scheduling.or(&configuration.run.scheduling),
        };
        StagePlan {
            programs,
            scheduling,
            restart: own.restart,
            outlives_restarts: live && name == StageId::RadarReplay.name() && !is_link,
            // Live masking alone knows which scans it admitted, and on a base the link which of
            // them have come.
            restarts_all: live && (name == StageId::Masking.name() || is_base),
            // The robot waits until it knows that the base has all.
            end_timeout: match is_base {
                true => LinkConfig::END_TIMEOUT + END_TIMEOUT,
                false => END_TIMEOUT,
            },
            ..StagePlan::new(name, command)
        }
    };
    let stages = StageId::ALL.into_iter();
    let stages = stages.filter(|stage| configuration.starts(*stage));
    let window = configuration.window(None, 1);
    // With keyframes for the other side of a link there is no SLAM here.
    let has_slam = configuration.slam.is_on();
    let is_here = |it: &FollowerId| has_slam || *it == FollowerId::Objects;
    let followers = FollowerId::ALL.into_iter();
    let followers = followers.filter(|it| is_here(it) && it.is_in(&window));
    let followers = followers.map(FollowerId::name);
    let names = stages.map(StageId::name).chain(followers);
    names.map(plan).collect()
}

pub fn recorder(record: &RecordConfig, gyre: &Path, out: &Path) -> Option<StagePlan> {
    if !record.is_on() {
        return None;
    }
    let [gyre, out, file] = [gyre, out, record.file.as_path()].map(Path::to_string_lossy);
    let limits = [
        ("--split-mb", record.split_mb.to_string()),
        ("--split-s", record.split_s.to_string()),
        ("--keep-mb", record.keep_mb.to_string()),
        ("--keep-s", record.keep_s.to_string()),
    ];
    let topics = record.topics.join(",");
    let mut command = vec![&*gyre, "record", &*out, "--continues", "--to", &*file];
    command.extend(limits.iter().flat_map(|(name, limit)| [*name, limit]));
    if !topics.is_empty() {
        command.extend(["--topics", &topics]);
    }
    let command = command.into_iter().map(str::to_owned).collect();
    Some(StagePlan {
        outlives_restarts: true,
        ..StagePlan::new("recorder", command)
    })
}

/// Checks that a run overwrites no recording except one that it continues.
pub fn require_recordable(record: &RecordConfig, out: &Path, goes_on: bool) -> Result<(), Failure> {
    match (record.is_on(), goes_on) {
        (true, true) => Ok(gyre_watch::recorder::require_own(&record.file, out)?),
        (true, false) => Ok(gyre_watch::recorder::require_new(&record.file)?),
        (false, _) => Ok(()),
    }
}

pub fn digest(path: &Path) -> io::Result<String> {
    let mut digest = Hasher::new();
    digest.update_reader(gyre_storage::open(path)?)?;
    Ok(digest.finalize().to_string())
}

/// Returns the BLAKE3 digest of what replaces each stage: of its words and the files that it names.
pub fn replaced(configuration: &Configuration) -> io::Result<BTreeMap<String, String>> {
    let stages = stage_plans(configuration, &own());
    let replaced = stages.iter().filter(|stage| !stage.programs.is_empty());
    let of = |stage: &StagePlan| -> io::Result<(String, String)> {
        let mut both = Hasher::new();
        let replacement = configuration.stages.get(&stage.name);
        for word in replacement.map_or_else(Vec::new, StageConfig::replacement) {
            both.update(&(word.len() as u64).to_le_bytes());
            both.update(word.as_bytes());
        }
        for program in &stage.programs {
            both.update(digest(program.path())?.as_bytes());
        }
        Ok((stage.name.clone(), both.finalize().to_string()))
    };
    replaced.map(of).collect()
}

/// Returns the programs of a run: this build of Gyre, and what replaces its stages.
pub fn programs(configuration: &Configuration) -> io::Result<Programs> {
    Ok(Programs::new(digest(&own())?, replaced(configuration)?))
}
