//! Commands that change the poses of a run from a scan on. They are inputs of a run, as its scans
//! are: `journal/commands.jsonl` has each with the time of its first scan. So a resumed run
//! computes the same poses. Another run does too that has the file as its `source.commands`.
//!
//! The supervisor appends a command. Masking, which numbers the scans, appends the time of the next
//! scan, before it publishes that scan with the number of commands that apply to it
//! ([`Item::commands`](crate::Item)).

use std::{
    fs::{self, OpenOptions},
    io::{self, Seek, Write},
    mem,
    path::{Path, PathBuf},
};

use gyre_geometry::{UncertainMotion, covariance, pose};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::wire::REACH_M;

const FILE: &str = "journal/commands.jsonl";
/// Commands of a run. A file that is too large to be read would end the run for good.
const MOST: u64 = 20_000;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Command {
    /// Begin a new chain of motions at a pose of the odometry. With `keep_map` SLAM continues its
    /// map: the pose is a measurement of its deviations. Without it SLAM begins a new map there.
    Reset { at: GivenPose, keep_map: bool },
    /// Begin a new map of SLAM with the next scan; the chain of motions continues.
    NewMap {},
    /// The pose of the vehicle in the map of `slam.map`.
    Locate { at: GivenPose },
}

/// A pose that a person or another program has given: metres and radians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GivenPose {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Standard deviations of x and of y, and of the yaw.
    pub sigma_m: f64,
    pub sigma_rad: f64,
}

/// The deviations of a pose that is given by hand in RViz.
impl Default for GivenPose {
    fn default() -> Self {
        Self {
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
            sigma_m: 0.5,
            sigma_rad: std::f64::consts::PI / 12.0,
        }
    }
}

impl GivenPose {
    pub fn pose(&self) -> UncertainMotion {
        let [place, yaw] = [self.sigma_m, self.sigma_rad].map(|sigma| sigma.powi(2));
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&[place, 0.0, 0.0, place, 0.0, yaw]),
        }
    }

    fn is_valid(&self) -> bool {
        let is_place = |m: f64| m.abs() <= REACH_M;
        let is_deviation = |value: f64| value > 0.0 && value <= REACH_M;
        is_place(self.x_m)
            && is_place(self.y_m)
            && self.yaw_rad.is_finite()
            && is_deviation(self.sigma_m)
            && is_deviation(self.sigma_rad)
    }
}

impl Command {
    /// Returns whether a chain of motions starts with the next scan.
    pub fn starts_chain(&self) -> bool {
        matches!(self, Self::Reset { .. })
    }

    /// Returns whether SLAM drops its map.
    pub fn starts_map(&self) -> bool {
        matches!(
            self,
            Self::Reset {
                keep_map: false,
                ..
            } | Self::NewMap {}
        )
    }

    pub fn check(&self) -> Result<(), String> {
        match self {
            Self::NewMap {} => Ok(()),
            Self::Reset { at, .. } | Self::Locate { at } if at.is_valid() => Ok(()),
            _ => Err(format!(
                "a given pose has finite numbers within {REACH_M} m and deviations above 0"
            )),
        }
    }
}

#[derive(Debug, Error)]
pub enum CommandError {
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
    #[error("{} line {line}: {reason}", path.display())]
    Line {
        path: PathBuf,
        line: usize,
        reason: String,
    },
}

/// A line of the file: a command, or the time of its first scan, or both.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    number: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    command: Option<Command>,
    /// Time of the scan, ns since 1970 on the sensor's clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    from_ns: Option<i64>,
}

/// The commands of a run, in their order; their numbers begin at 1.
#[derive(Debug)]
pub struct Commands {
    path: PathBuf,
    read_bytes: u64,
    lines: usize,
    given: Vec<(Command, Option<i64>)>,
}

impl Commands {
    /// Reads the commands of the run that writes to `out`; a missing file is empty.
    pub fn open(out: &Path) -> Result<Self, CommandError> {
        Self::read(&out.join(FILE))
    }

    pub fn read(path: &Path) -> Result<Self, CommandError> {
        let mut commands = Self {
            path: path.to_owned(),
            read_bytes: 0,
            lines: 0,
            given: Vec::new(),
        };
        commands.refresh()?;
        Ok(commands)
    }

    pub fn path_in(out: &Path) -> PathBuf {
        out.join(FILE)
    }

    /// Returns the number of commands.
    pub fn len(&self) -> u64 {
        self.given.len() as u64
    }

    pub fn is_empty(&self) -> bool {
        self.given.is_empty()
    }

    /// Returns the time of the first scan of a command; `None` until that is known.
    pub fn from_ns(&self, number: u64) -> Option<i64> {
        let index = usize::try_from(number).ok()?.checked_sub(1)?;
        self.given.get(index)?.1
    }

    /// Returns the number of commands that no scan has taken: the last ones.
    pub fn waiting(&self) -> u64 {
        let last = self.given.iter().rev();
        last.take_while(|(_, from_ns)| from_ns.is_none()).count() as u64
    }

    /// Writes the commands that scans have taken to the folder of another run, which applies each
    /// from the same time on.
    pub fn give(&self, out: &Path) -> Result<(), CommandError> {
        let mut text = String::new();
        let taken = 1..=self.len() - self.waiting();
        for (number, &(command, from_ns)) in taken.zip(&self.given) {
            text += &self.text(&Line {
                number,
                command: Some(command),
                from_ns,
            })?;
        }
        let written = gyre_storage::write(&out.join(FILE), text);
        written.map_err(|error| self.failed(io::Error::other(error)))
    }

    /// Returns the commands with the numbers after `before` up to `until`.
    pub fn between(&self, before: u64, until: u64) -> impl Iterator<Item = &Command> {
        let count = until.saturating_sub(before) as usize;
        let commands = self.given.iter().skip(before as usize).take(count);
        commands.map(|(command, _)| command)
    }

    /// Returns the number of the last command of a kind; 0 without one.
    pub fn last(&self, is_of_kind: impl Fn(&Command) -> bool) -> u64 {
        let mut commands = self.given.iter();
        let index = commands.rposition(|(command, _)| is_of_kind(command));
        index.map_or(0, |index| index as u64 + 1)
    }

    /// Reads the lines that others have appended.
    pub fn refresh(&mut self) -> Result<(), CommandError> {
        let length = match fs::metadata(&self.path) {
            Ok(file) => file.len(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(self.failed(error)),
        };
        if length == self.read_bytes {
            return Ok(());
        }
        let text = gyre_storage::read_text(&self.path, gyre_storage::SETTINGS);
        let text = text.map_err(|error| self.failed(error))?;
        let new = text.get(self.read_bytes as usize..).unwrap_or_default();
        // A line that is being written is read later.
        let whole = &new[..new.rfind('\n').map_or(0, |end| end + 1)];
        for line in whole.lines() {
            self.lines += 1;
            self.take(line).map_err(|reason| CommandError::Line {
                path: self.path.clone(),
                line: self.lines,
                reason,
            })?;
        }
        self.read_bytes += whole.len() as u64;
        Ok(())
    }

    fn take(&mut self, text: &str) -> Result<(), String> {
        let line: Line = serde_json::from_str(text).map_err(|error| error.to_string())?;
        let next = self.len() + 1;
        if let Some(command) = line.command {
            command.check()?;
            if line.number != next {
                return Err(format!("its number is {}, but {next} follows", line.number));
            }
            self.given.push((command, None));
        }
        if let Some(from_ns) = line.from_ns {
            let unknown = || format!("a command {} is unknown", line.number);
            let index = (line.number as usize).checked_sub(1).ok_or_else(unknown)?;
            let given = self.given.get_mut(index).ok_or_else(unknown)?;
            // The first one stays: another process may have read it.
            given.1 = given.1.or(Some(from_ns));
        }
        Ok(())
    }

    /// Appends a command, and returns its number.
    pub fn add(&mut self, command: Command) -> Result<u64, CommandError> {
        self.refresh()?;
        let number = self.len() + 1;
        if number > MOST {
            let reason = format!("the run has had {MOST} commands: begin another");
            return Err(self.failed(io::Error::other(reason)));
        }
        self.append(&Line {
            number,
            command: Some(command),
            from_ns: None,
        })?;
        if let Some(folder) = self.path.parent().filter(|_| number == 1) {
            // The name of the new file survives a power failure, as the poses with its numbers do.
            let synchronised = gyre_storage::sync_folder(folder);
            synchronised.map_err(|error| self.failed(io::Error::other(error)))?;
        }
        Ok(number)
    }

    /// Returns the number of commands that apply to a scan. If it takes new commands, those that
    /// have no time yet apply from this scan on.
    pub fn apply(&mut self, stamp_ns: i64, takes_new: bool) -> Result<u64, CommandError> {
        self.refresh()?;
        while takes_new && self.waiting() > 0 {
            let appended = self.append(&Line {
                number: self.len() - self.waiting() + 1,
                command: None,
                from_ns: Some(stamp_ns),
            });
            match appended {
                // It applies when the disk has room: all processes have to know the time.
                Err(CommandError::File { source, .. }) if gyre_storage::is_full(&source) => break,
                appended => appended?,
            }
        }
        Ok(self.applied(stamp_ns))
    }

    /// Returns the number of commands up to the last one whose time is up to the time of a scan:
    /// where the sensor's clock has stepped back, those before have later times.
    pub fn applied(&self, stamp_ns: i64) -> u64 {
        let applies = |given: &(Command, Option<i64>)| given.1.is_some_and(|ns| ns <= stamp_ns);
        let last = self.given.iter().rposition(applies);
        last.map_or(0, |index| index as u64 + 1)
    }

    fn append(&mut self, line: &Line) -> Result<(), CommandError> {
        self.append_text(&self.text(line)?)
            .map_err(|error| self.failed(error))?;
        self.refresh()
    }

    fn text(&self, line: &Line) -> Result<String, CommandError> {
        let text = serde_json::to_string(line).map_err(|error| self.failed(error.into()))?;
        Ok(text + "\n")
    }

    fn append_text(&self, text: &str) -> io::Result<()> {
        let mut options = OpenOptions::new();
        let mut file = options.create(true).append(true).open(&self.path)?;
        // One write, since two processes append.
        let written = file.write(text.as_bytes())?;
        if written < text.len() {
            // The next line must not continue the part that a full disk has taken.
            let end = file.stream_position()?;
            file.set_len(end - written as u64)?;
            return Err(io::ErrorKind::StorageFull.into());
        }
        file.sync_data()
    }

    /// Cuts off a line that a power failure has cut short, which the next one would continue.
    /// Before the processes of the run begin.
    pub fn cut_torn(out: &Path) -> Result<(), CommandError> {
        let commands = Self::open(out)?;
        let cut = |path: &Path| {
            let file = OpenOptions::new().write(true).open(path)?;
            file.set_len(commands.read_bytes)?;
            file.sync_data()
        };
        match cut(&commands.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            cut => cut.map_err(|error| commands.failed(error)),
        }
    }

    fn failed(&self, source: io::Error) -> CommandError {
        CommandError::File {
            path: self.path.clone(),
            source,
        }
    }
}

/// Reads the commands of a run along its scans, as a follower does.
#[derive(Debug)]
pub struct CommandsOfScans {
    commands: Commands,
    /// Number of commands that applied to the scan before.
    before: u64,
}

impl CommandsOfScans {
    pub fn open(out: &Path) -> Result<Self, CommandError> {
        Ok(Self {
            commands: Commands::open(out)?,
            before: 0,
        })
    }

    /// Begins again with the first scan.
    pub fn restart(&mut self) {
        self.before = 0;
    }

    /// Returns the commands that are new with the next scan, of this time, ns.
    pub fn of_scan(
        &mut self,
        stamp_ns: i64,
    ) -> Result<impl Iterator<Item = &Command>, CommandError> {
        self.commands.refresh()?;
        let apply = self.commands.applied(stamp_ns).max(self.before);
        let before = mem::replace(&mut self.before, apply);
        Ok(self.commands.between(before, apply))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESET: Command = Command::Reset {
        at: GivenPose {
            x_m: 3.0,
            y_m: -1.0,
            yaw_rad: 0.5,
            sigma_m: 0.2,
            sigma_rad: 0.1,
        },
        keep_map: true,
    };

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("journal")).unwrap();
        folder
    }

    #[test]
    fn a_command_applies_from_the_next_scan_on_for_each_process_that_reads_it() {
        let folder = folder();
        let [mut supervisor, mut masking] =
            [(); 2].map(|()| Commands::open(folder.path()).unwrap());
        assert_eq!(masking.apply(100, true).unwrap(), 0);
        assert_eq!(supervisor.add(RESET).unwrap(), 1);
        assert_eq!(masking.apply(200, true).unwrap(), 1);
        let mut restarted = Commands::open(folder.path()).unwrap();
        assert_eq!(
            [100, 199, 200].map(|ns| restarted.apply(ns, true).unwrap()),
            [0, 0, 1]
        );
        supervisor.refresh().unwrap();
        assert_eq!(supervisor.from_ns(1), Some(200));
        assert_eq!(supervisor.between(0, 1).collect::<Vec<_>>(), [&RESET]);
        assert_eq!(supervisor.between(1, 1).count(), 0);
        // The clock steps back.
        supervisor.add(RESET).unwrap();
        assert_eq!(masking.apply(150, true).unwrap(), 2);

        supervisor.add(RESET).unwrap();
        assert_eq!(supervisor.waiting(), 1);
        let other = self::folder();
        supervisor.give(other.path()).unwrap();
        let mut replay = Commands::open(other.path()).unwrap();
        assert_eq!((replay.len(), replay.waiting()), (2, 0));
        assert_eq!([140, 150].map(|ns| replay.apply(ns, true).unwrap()), [0, 2]);
    }

    #[test]
    fn a_line_that_is_being_written_is_read_when_it_is_whole() {
        let folder = folder();
        let mut commands = Commands::open(folder.path()).unwrap();
        commands.add(RESET).unwrap();
        let path = Commands::path_in(folder.path());
        let whole = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{whole}{{\"number\":1,\"fr")).unwrap();
        commands.refresh().unwrap();
        assert_eq!(commands.from_ns(1), None);
        Commands::cut_torn(folder.path()).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), whole);
        fs::write(&path, format!("{whole}{{\"number\":1,\"from_ns\":7}}\n")).unwrap();
        commands.refresh().unwrap();
        assert_eq!(commands.from_ns(1), Some(7));
    }

    #[test]
    fn an_invalid_line_is_refused_with_its_number() {
        let folder = folder();
        let path = Commands::path_in(folder.path());
        for (line, expected) in [
            (
                r#"{"number":2,"command":{"locate":{"at":{}}}}"#,
                "1 follows",
            ),
            (r#"{"number":1,"from_ns":5}"#, "command 1 is unknown"),
            (
                r#"{"number":1,"command":{"locate":{"at":{"x_m":1e300}}}}"#,
                "within",
            ),
            (r#"{"number":1,"command":{"leave":{}}}"#, "leave"),
        ] {
            fs::write(&path, format!("{line}\n")).unwrap();
            let refused = Commands::open(folder.path()).unwrap_err().to_string();
            assert!(
                refused.contains("line 1") && refused.contains(expected),
                "{refused}"
            );
        }
    }
}
