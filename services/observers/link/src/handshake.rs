//! The agreement of both sides of a split run on the item where they continue, at each start of the
//! robot's side.

use std::{fs, path::Path, thread, time::Duration};

use gyre_client::{Manifest, RunError};
use gyre_contract::{
    Limits,
    run::{BEGUN_WITH, LinkConfig, Side},
    topic,
};
use serde::{Deserialize, Serialize};
use zenoh::{Session, Wait};

use crate::{error::failed, request::Question, session};

/// Time between two questions before a run exists, whose own waits take over.
const PAUSE: Duration = Duration::from_millis(200);

const ASK_FOR_SCANS: Question = Question("ask the robot for its scans", "the robot");
const ASK_FOR_START: Question = Question("ask the base where to continue", "the base");

pub(crate) fn prefix(config: &LinkConfig, sender: Side) -> String {
    let side = match sender {
        Side::Robot => "robot",
        Side::Base => "base",
    };
    format!("gyre/split/{}/{side}", config.name)
}

pub(crate) fn start_key(config: &LinkConfig) -> String {
    format!("{}/begin", prefix(config, Side::Base))
}

pub(crate) fn scan_size_key(config: &LinkConfig) -> String {
    format!("{}/scans", prefix(config, Side::Robot))
}

/// Waits for the robot and asks for the bytes of its largest scan, which a base needs that receives
/// scans.
pub fn ask_robot(config: &LinkConfig) -> Result<usize, RunError> {
    let pause = || {
        thread::sleep(PAUSE);
        Ok(false)
    };
    let session = session::open(config, pause)?;
    let failed = || failed(ASK_FOR_SCANS.0, &"it was interrupted");
    let session = session.ok_or_else(failed)?;
    loop {
        if let Some(bytes) = ASK_FOR_SCANS.ask(&session, scan_size_key(config), [])? {
            let _ = session.close().wait();
            return Ok(bytes);
        }
        thread::sleep(PAUSE);
    }
}

/// The properties of a run on which both sides must agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Agreement {
    cut: String,
    live: bool,
    refines: bool,
    window: usize,
    look_back: usize,
    limits: Limits,
    /// The versions of the messages that cross the link.
    topics: Vec<String>,
    /// The checksum of the robot's recording, if it plays one.
    pub drive: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum StartAnswer {
    /// Items up to this one will have poses; `None`: there are no poses yet.
    Go(Option<u64>),
    Wait(String),
    Refused(String),
}

impl Agreement {
    pub fn of(manifest: &Manifest, config: &LinkConfig, topics: &[&'static str]) -> Self {
        let topics = topics.iter().chain(&["motion", "pose"]);
        let versions = topics.filter_map(|name| Some(topic(name)?.header.name.to_owned()));
        Self {
            cut: config.cut.name().to_owned(),
            live: manifest.live,
            refines: manifest.refines,
            window: manifest.window.scans,
            look_back: manifest.window.look_back,
            limits: manifest.limits,
            topics: versions.collect(),
            drive: drive(&manifest.out),
        }
    }

    /// Returns the properties by the names that a user knows.
    fn properties(&self) -> [(&'static str, String); 10] {
        let limits = &self.limits;
        let mode = if self.live { "live" } else { "lossless" };
        let look_back = self.look_back.to_string();
        [
            ("link.cut", self.cut.clone()),
            ("run.mode", mode.to_owned()),
            ("run.window", self.window.to_string()),
            ("raster.n", limits.side().to_string()),
            ("raster.cell_m", limits.cell_m.to_string()),
            ("points.capacity", limits.points.to_string()),
            ("the number of scans of a mask", limits.rasters.to_string()),
            ("refinement", self.refines.to_string()),
            ("the scans that stages look back", look_back),
            // A topic that only one side has would be waited for to the end.
            ("the list of topics", self.topics.join(", ")),
        ]
    }

    /// Returns a sentence that explains why the robot's side belongs to a different run; `None` if
    /// it is not.
    pub fn difference(&self, robot: &Self) -> Option<String> {
        let mut properties = robot.properties().into_iter().zip(self.properties());
        let ((key, robot), (_, base)) = properties.find(|(robot, base)| robot != base)?;
        Some(format!(
            "{key} is {robot} on the robot and {base} on the base: give both the same"
        ))
    }
}

/// Returns the checksum of the recording that a run plays; `None` of a radar, and on the base.
fn drive(out: &Path) -> Option<String> {
    let text = fs::read_to_string(out.join(BEGUN_WITH)).ok()?;
    let begun: toml::Table = text.parse().ok()?;
    Some(begun.get("recording")?.get("sha256")?.as_str()?.to_owned())
}

/// Asks the base where to continue; `None`: it does not answer.
pub(crate) fn ask_base(
    session: &Session,
    config: &LinkConfig,
    agreement: &Agreement,
) -> Result<Option<StartAnswer>, RunError> {
    let payload = serde_json::to_vec(agreement);
    let payload = payload.map_err(|e| failed(ASK_FOR_START.0, &e))?;
    ASK_FOR_START.ask(session, start_key(config), payload)
}
