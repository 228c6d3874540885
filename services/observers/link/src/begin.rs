//! How the two sides of a split run agree where to go on, each time when the robot's side starts.

use std::{fs, path::Path, thread, time::Duration};

use gyre_messages::{Limits, topic};
use gyre_stage::{Manifest, run::BEGUN_WITH};
use serde::{Deserialize, Serialize};
use zenoh::{Session, Wait};

use crate::{LinkConfig, LinkError, Side};

/// Time for an answer. Without one it is asked again.
const ANSWER: Duration = Duration::from_secs(1);
/// Time between two questions before there is a run that waits by itself.
const PAUSE: Duration = Duration::from_millis(200);

/// Returns the prefix of the keys of what one side sends.
pub(crate) fn prefix(config: &LinkConfig, sender: Side) -> String {
    let side = match sender {
        Side::Robot => "robot",
        Side::Base => "base",
    };
    format!("gyre/split/{}/{side}", config.name)
}

/// The key at which a base says where to go on.
pub(crate) fn key(config: &LinkConfig) -> String {
    format!("{}/begin", prefix(config, Side::Base))
}

/// The key at which a robot says what its scans are.
pub(crate) fn scans_key(config: &LinkConfig) -> String {
    format!("{}/scans", prefix(config, Side::Robot))
}

/// The scans of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scans {
    /// Bytes of the largest.
    pub bytes: usize,
}

/// Waits for the robot and asks for its scans, which a base needs to know that has them sent.
///
/// # Errors
/// A link that cannot be opened.
pub fn ask_robot(config: &LinkConfig) -> Result<Scans, LinkError> {
    let pause = || {
        thread::sleep(PAUSE);
        Ok(false)
    };
    let session = config.network().open(pause)?;
    let failed = || LinkError::zenoh("ask the robot for its scans", &"it was interrupted");
    let session = session.ok_or_else(failed)?;
    loop {
        let asked = session.get(scans_key(config)).timeout(ANSWER).wait();
        let replies = asked.map_err(|e| LinkError::zenoh("ask the robot for its scans", &e))?;
        let reply = replies
            .recv()
            .ok()
            .and_then(|reply| reply.into_result().ok());
        let scans = reply.map(|sample| serde_json::from_slice(&sample.payload().to_bytes()));
        if let Some(Ok(scans)) = scans {
            let _ = session.close().wait();
            return Ok(scans);
        }
        thread::sleep(PAUSE);
    }
}

/// What both sides must agree on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Agreement {
    cut: String,
    live: bool,
    refines: bool,
    window: usize,
    look_back: usize,
    limits: Limits,
    /// The topics that cross the link, with the versions of their messages.
    topics: Vec<(String, String)>,
    /// What tells the robot's drive from another one, where anything does.
    pub drive: Option<String>,
}

/// The answer to a robot that starts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Answer {
    /// Items up to this one will have poses; `None`: there are none yet.
    Go(Option<u64>),
    /// Ask again: why.
    Wait(String),
    /// It is a side of another run: why.
    Refused(String),
}

impl Agreement {
    /// Returns that of this side.
    pub fn of(manifest: &Manifest, config: &LinkConfig, topics: &[&'static str]) -> Self {
        let versioned = |name: &&'static str| {
            let version = topic(name).map_or("", |topic| topic.header.name);
            ((*name).to_owned(), version.to_owned())
        };
        Self {
            cut: config.cut.name().to_owned(),
            live: manifest.live,
            refines: manifest.refines,
            window: manifest.window.scans,
            look_back: manifest.window.look_back,
            limits: manifest.limits,
            topics: topics
                .iter()
                .chain(&["motion", "pose"])
                .map(versioned)
                .collect(),
            drive: drive(&manifest.out),
        }
    }

    /// Returns why the other side is not one of the same run, in a sentence.
    pub fn difference(&self, robot: &Self) -> Option<String> {
        let mode = |live| if live { "live" } else { "lossless" };
        let differs = |key: &str, robot: String, base: String| {
            (robot != base).then(|| {
                format!("{key} is {robot} on the robot and {base} on the base: give both the same")
            })
        };
        let (ours, theirs) = (&self.limits, &robot.limits);
        differs("link.cut", robot.cut.clone(), self.cut.clone())
            .or_else(|| differs("run.mode", mode(robot.live).into(), mode(self.live).into()))
            .or_else(|| {
                differs(
                    "run.window",
                    robot.window.to_string(),
                    self.window.to_string(),
                )
            })
            .or_else(|| {
                differs(
                    "raster.n",
                    theirs.side().to_string(),
                    ours.side().to_string(),
                )
            })
            .or_else(|| {
                differs(
                    "raster.cell_m",
                    theirs.cell_m.to_string(),
                    ours.cell_m.to_string(),
                )
            })
            .or_else(|| {
                differs(
                    "points.capacity",
                    theirs.points.to_string(),
                    ours.points.to_string(),
                )
            })
            .or_else(|| {
                differs(
                    "the number of scans of a mask",
                    theirs.rasters.to_string(),
                    ours.rasters.to_string(),
                )
            })
            .or_else(|| {
                differs(
                    "refinement",
                    robot.refines.to_string(),
                    self.refines.to_string(),
                )
            })
            .or_else(|| {
                differs(
                    "the scans that stages look back",
                    robot.look_back.to_string(),
                    self.look_back.to_string(),
                )
            })
            .or_else(|| {
                // A topic that only one side has would be waited for to the end.
                let both = self.topics.iter().chain(&robot.topics);
                both.map(|(name, _)| name).find_map(|name| {
                    let of = |side: &Self| {
                        let found = side.topics.iter().find(|(topic, _)| topic == name);
                        found.map_or("none", |(_, version)| version).to_owned()
                    };
                    differs(&format!("topic `{name}`"), of(robot), of(self))
                })
            })
    }
}

/// Returns what tells the recording that a run plays from another one; `None` of a radar, and on the base.
fn drive(out: &Path) -> Option<String> {
    let text = fs::read_to_string(out.join(BEGUN_WITH)).ok()?;
    let begun: toml::Table = text.parse().ok()?;
    Some(begun.get("recording")?.get("sha256")?.as_str()?.to_owned())
}

/// Asks the base where to go on; `None`: it does not answer.
pub(crate) fn ask(
    session: &Session,
    config: &LinkConfig,
    agreement: &Agreement,
) -> Result<Option<Answer>, LinkError> {
    let failed = |e: &dyn std::fmt::Display| LinkError::zenoh("ask the base where to go on", e);
    let payload = serde_json::to_vec(agreement).map_err(|e| failed(&e))?;
    let replies = session
        .get(key(config))
        .payload(payload)
        .timeout(ANSWER)
        .wait()
        .map_err(|e| failed(&e))?;
    let Ok(reply) = replies.recv() else {
        return Ok(None);
    };
    let Ok(sample) = reply.into_result() else {
        return Ok(None);
    };
    let answer = serde_json::from_slice(&sample.payload().to_bytes());
    let other = |_| {
        LinkError::Refused(
            "the base is another version of gyre: install the same on both".to_owned(),
        )
    };
    answer.map(Some).map_err(other)
}
