//! Shared by the whole-pipeline tests: a [`Run`] is a `gyre run` command with results of its own,
//! [`Running`] is one that is running, [`Ended`] its output. Every run that ends is checked to have
//! left nothing behind.

// Each test binary uses its own part of this.
#![allow(dead_code, unused_imports, unused_macros, clippy::unwrap_used)]

mod browser;
mod ended;
pub mod leftovers;
pub mod odometry;
mod other_user;
pub mod processes;
pub mod recording;
mod running;
mod server;
mod shared;
mod spawned;
mod watch;

use std::{
    env,
    ffi::OsStr,
    fs::{self, File},
    io::Write,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{Arc, OnceLock},
};

use serde_json::Value;
use tempfile::TempDir;

pub use browser::Browser;
pub use ended::Ended;
pub use leftovers::{assert_nothing_left, assert_nothing_left_of};
pub use other_user::OtherUser;
pub use processes::{Pid, send};
pub use running::{Running, poses_of};
pub use server::{Server, asked};
pub use shared::Shared;
pub use spawned::Spawned;
pub use watch::{Watch, Watched};

/// The stages of a run that does not search jointly, in the order of the stream.
pub const STAGES: [&str; 6] = [
    "radar-replay",
    "masking",
    "rotation-search",
    "translation-search",
    "refinement",
    "pose-integration",
];

/// Those between source and sink.
pub const BETWEEN: &[&str] = STAGES.split_at(STAGES.len() - 1).0.split_at(1).1;

/// Small rasters: the tests are about processes.
const CONFIGURATION: &str = "[raster]\nn = 127\ncell_m = 0.8\n";

/// A folder with `small.toml`, the configuration of small rasters.
pub fn folder() -> TempDir {
    let folder = tempfile::Builder::new()
        .prefix("gyre-test-")
        .tempdir()
        .unwrap();
    fs::write(folder.path().join("small.toml"), CONFIGURATION).unwrap();
    folder
}

/// The Python for tests in Python: it may have packages that `python3` lacks.
pub fn python() -> String {
    env::var("GYRE_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// A script of `tests/` for this Python.
pub fn script(path: &str) -> Command {
    let mut command = Command::new(python());
    command.arg(Path::new(crate::PROJECT).join("tests").join(path));
    command
}

pub fn gyre() -> Command {
    Command::new(crate::PROGRAM)
}

/// Runs `gyre` with these words, each a text or a path, to its end. Lists of words come behind `;`.
macro_rules! finished {
    ($($word:expr),* $(; $words:expr)*) => {{
        let mut command = $crate::common::gyre();
        $(command.arg($word);)*
        $(command.args($words);)*
        $crate::common::Ended::of(command)
    }};
}
pub(crate) use finished;

/// The paths of the files and folders in a folder, sorted; none where it is missing.
pub fn entries_of(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

/// Their names.
pub fn names_in(folder: &Path) -> Vec<String> {
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    entries_of(folder).iter().map(name).collect()
}

pub fn works(command: &[&str]) -> bool {
    let output = Command::new(command[0]).args(&command[1..]).output();
    output.is_ok_and(|output| output.status.success())
}

/// Returns whether a command works here; prints why a test is skipped.
pub fn can(command: &[&str]) -> bool {
    let can = works(command);
    if !can {
        println!("skips what needs `{}`", command.join(" "));
    }
    can
}

/// Returns whether this user can mount; prints why a test is skipped.
pub fn can_mount() -> bool {
    can(&[
        "unshare", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt",
    ])
}

/// Makes a program of this content.
///
/// A process of its own writes it. If this one had it open for writing, a process that another test
/// starts at that moment would inherit that, and the program could not be executed ("text file
/// busy").
pub fn install(program: &Path, content: impl AsRef<[u8]>) {
    let mut writer = Command::new("sh")
        .args(["-c", "cat > \"$0\" && chmod 755 \"$0\""])
        .arg(program)
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = writer.stdin.take().unwrap();
    input.write_all(content.as_ref()).unwrap();
    drop(input);
    assert!(writer.wait().unwrap().success());
}

pub fn copy_program(to: &Path) {
    install(to, fs::read(crate::PROGRAM).unwrap());
}

/// The same command, executed by a program that becomes it.
pub fn wrapped(by: &[&str], command: &Command) -> Command {
    let mut wrapped = Command::new(by[0]);
    wrapped
        .args(&by[1..])
        .arg(command.get_program())
        .args(command.get_args());
    wrapped
}

/// The command with a mount of its own; `None` where the system does not permit that.
pub fn with_mount(mount: &str, command: &Command) -> Option<Command> {
    let script = format!("mount {mount} && exec \"$@\"");
    let unshare = ["unshare", "--mount", "sh", "-c", &script, "sh"];
    can_mount().then(|| wrapped(&unshare, command))
}

/// The command with a file system of its own at `place`; `None` as above.
pub fn with_tmpfs(command: &Command, place: &Path, options: &str) -> Option<Command> {
    let place = place.display();
    with_mount(&format!("-t tmpfs -o {options} tmpfs '{place}'"), command)
}

/// A folder of real data; prints why and returns `None` if the folder is missing.
pub fn real_data(folder: &str) -> Option<PathBuf> {
    match env::var_os("GYRE_DATA") {
        Some(data) => Some(Path::new(&data).join(folder)),
        None => {
            println!("skipped: GYRE_DATA is not set");
            None
        }
    }
}

/// Returns whether networks can be computed here; prints why a test is skipped.
pub fn runtime_is_installed() -> bool {
    let found = gyre_masking::networks::runtime::find(None).is_ok();
    if !found {
        println!("skipped: ONNX Runtime is not installed");
    }
    found
}

/// A `gyre run` command: start it as often as you like, it has the same results directory each
/// time.
#[derive(Clone, Debug)]
pub struct Run {
    folder: Arc<TempDir>,
    out: PathBuf,
    configuration: PathBuf,
    arguments: Vec<String>,
}

impl Run {
    /// A run of the small recording, as fast as it goes.
    pub fn of_recording() -> Self {
        Self::small().data(recording::small())
    }

    /// A run of small rasters whose recording is still to be named.
    pub fn small() -> Self {
        Self::configured(CONFIGURATION)
    }

    pub fn configured(text: &str) -> Self {
        let folder = folder();
        let configuration = folder.path().join("test.toml");
        fs::write(&configuration, text).unwrap();
        let out = folder.path().join("out");
        Self {
            folder: Arc::new(folder),
            out,
            configuration,
            arguments: Vec::new(),
        }
    }

    /// A run of a simulation of so many scans on small rasters.
    pub fn simulated(scans: usize) -> Self {
        Self::configured(&format!("{CONFIGURATION}[simulation]\nscans = {scans}\n"))
    }

    pub fn of_file(configuration: &Path) -> Self {
        Self {
            configuration: configuration.to_owned(),
            ..Self::configured("")
        }
    }

    /// A run of the demo, whose model is named as in the root of the project.
    pub fn of_demo() -> Self {
        let project = Path::new(crate::PROJECT);
        let model = project.join("models/gyre-255.toml");
        Self::of_file(&project.join("configs/demo.toml"))
            .set(&format!("masking.model='{}'", model.display()))
    }

    pub fn of_recorded_demo() -> Self {
        Self::of_demo().data(recording::demo())
    }

    pub fn data(self, folder: &Path) -> Self {
        self.option(folder.to_str().unwrap())
    }

    pub fn rate(self, rate: &str) -> Self {
        self.argument("--rate", rate)
    }

    pub fn set(self, sentence: &str) -> Self {
        self.argument("--set", sentence)
    }

    /// Sets several keys, whose sentences spaces part.
    pub fn sets(self, sentences: &str) -> Self {
        sentences.split_whitespace().fold(self, Self::set)
    }

    pub fn masked_by(self, card: &Path) -> Self {
        self.sets(&format!(
            "masking.kind=learned masking.model='{}'",
            card.display()
        ))
    }

    pub fn into(mut self, out: &Path) -> Self {
        self.out = out.to_owned();
        self
    }

    pub fn argument(mut self, option: &str, value: &str) -> Self {
        self.arguments.extend([option.to_owned(), value.to_owned()]);
        self
    }

    pub fn option(mut self, word: &str) -> Self {
        self.arguments.push(word.to_owned());
        self
    }

    /// The same with an executable shell script for a stage; `{gyre}` in it stands for the program
    /// under test.
    pub fn stage_script(self, stage: &str, script: &str) -> Self {
        let path = self.folder.path().join(format!("{stage}.sh"));
        let script = script.replace("{gyre}", crate::PROGRAM);
        install(&path, format!("#!/bin/sh\n{script}\n"));
        let command = format!("stages.{stage}.command=['{}']", path.display());
        self.set(&command)
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    pub fn out(&self) -> &Path {
        &self.out
    }

    pub fn command(&self) -> Command {
        let mut command = gyre();
        command
            .arg("run")
            .arg(&self.configuration)
            .args(&self.arguments)
            .arg("--out")
            .arg(&self.out);
        command
    }

    pub fn start(&self) -> Running {
        self.start_as(self.command())
    }

    /// Starts it, and waits for so many poses.
    pub fn started(&self, poses: usize) -> Running {
        let mut running = self.start();
        running.await_poses(poses);
        running
    }

    /// Starts it by another command that becomes it, a shell's `exec` for instance.
    pub fn start_as(&self, mut command: Command) -> Running {
        let file = |name| File::create(self.folder.path().join(name)).unwrap();
        command
            .stdin(Stdio::null())
            .stdout(file("stdout.txt"))
            .stderr(file("stderr.txt"));
        // Without this a backtrace in text for a person would go unnoticed.
        command.env("RUST_BACKTRACE", "1").env_remove("GYRE_LOG");
        Running::new(self.clone(), command.spawn().unwrap())
    }

    pub fn finish(&self) -> Ended {
        self.start().finish()
    }

    /// Starts it at a rate, and interrupts it after so many poses.
    pub fn interrupt(&self, rate: &str, poses: usize) {
        self.clone().rate(rate).started(poses).interrupt();
    }

    /// Starts it, waits until it ends well, and returns its `odometry.csv`.
    pub fn complete(&self) -> String {
        self.finish().succeeded();
        self.odometry()
    }

    pub fn odometry(&self) -> String {
        self.result("odometry.csv")
    }

    pub fn summary(&self) -> Value {
        serde_json::from_str(&self.result("summary.json")).unwrap()
    }

    /// A number of the summary; its key may be a path of keys.
    pub fn count(&self, key: &str) -> u64 {
        let summary = self.summary();
        let count = summary.pointer(&format!("/{key}"));
        let count = count.and_then(Value::as_u64);
        count.unwrap_or_else(|| panic!("no {key} in {summary:#}"))
    }

    /// Asserts numbers of the summary: `key=number`, with spaces between.
    pub fn assert_counts(&self, expected: &str) {
        for (key, count) in expected.split(' ').filter_map(|it| it.split_once('=')) {
            assert_eq!(self.count(key).to_string(), count, "{key}");
        }
    }

    pub fn result(&self, name: impl AsRef<Path>) -> String {
        let path = self.out.join(name);
        fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    fn said(&self, name: impl AsRef<OsStr>) -> String {
        fs::read_to_string(self.folder.path().join(name.as_ref())).unwrap()
    }
}

/// `odometry.csv` of the small recording when nothing disturbs the run.
pub fn undisturbed() -> &'static str {
    static ODOMETRY: OnceLock<String> = OnceLock::new();
    ODOMETRY.get_or_init(|| Run::of_recording().complete())
}
