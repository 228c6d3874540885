//! The output paths of commands, and the lock of an output folder.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write},
    os::unix::fs::FileTypeExt,
    path::{Path, PathBuf},
};

use gyre_storage::{
    self as storage, SETTINGS, create_folder,
    lock::{Attempt, try_lock},
    read_text,
};
use thiserror::Error;

/// The figures of a run. It is put in place after all other results.
pub const SUMMARY: &str = "summary.json";

/// The ground truth of a simulation that is played without being stored.
pub const SIMULATED_TRUTH: &str = "ground_truth.tum";
pub const FILES: [&str; 15] = [
    "odometry.csv",
    "poses.csv",
    "objects.csv",
    "trajectory.tum",
    "trajectory.svg",
    "errors.svg",
    "bands.svg",
    "trajectory_slam.tum",
    "loops.csv",
    "graph.g2o",
    "bands_slam.svg",
    "map.png",
    "latency.json",
    SUMMARY,
    SIMULATED_TRUTH,
];

/// The lock of the folder, with the name of the command that fills it. It lies beside the results
/// and not in shared memory, which two runs need not have in common: containers have their own.
const LOCK: &str = ".lock";
/// The journal of a complete run while another run takes its place: until that has results, those
/// in the folder are of the complete run.
pub const REPLACED: &str = "journal.replaced";

/// The content that a command writes into a folder: the command, the file or folder that identifies
/// earlier content of its own, and the names of the files that it replaces.
#[derive(Clone, Copy, Debug)]
pub struct Content(&'static str, &'static str, &'static str);

#[rustfmt::skip]
impl Content {
    pub const RUN: Self = Self("gyre run", LOCK, "config.toml log.jsonl");
    pub const MAP: Self = Self("gyre map", LOCK, "map.toml map.png map.tif map.pgm map.yaml keyframes.log");
    pub const FIXES: Self = Self("gyre localise", LOCK, "fixes.csv fixes.tum fixes.png");
    pub const MASKS: Self = Self("gyre masks", "masks.png", "masks.png");
    pub const CALIBRATION: Self = Self("gyre calibrate", LOCK, "calibration.toml");
    pub const PLOTS: Self = Self("gyre evaluate", LOCK, "trajectory.svg errors.svg bands.svg");
    pub const STRESS: Self = Self("gyre stress", LOCK, "config.toml report.json");
    pub const SHADOW: Self = Self("gyre shadow", LOCK, "shadow.csv shadow.json shadow.txt");
    pub const BATCH: Self = Self("gyre batch", "rows", "results.csv times.csv benchmark.csv");
    pub const SIMULATION: Self = Self("gyre simulate", "simulation.toml", "dataset.toml ground_truth.tum azimuth_poses.npy objects.csv imu.csv wheels.csv gnss.csv Navtech_Polar.txt");
}

impl Content {
    /// Checks that this content replaces only files of its own command in a folder.
    pub fn require_place(&self, folder: &Path) -> Result<(), OutError> {
        let (Self(command, mark, files), path) = (self, folder.display());
        let refused = |reason| Err(OutError::Refused(reason));
        if fs::metadata(folder).is_ok_and(|there| !there.is_dir()) {
            return refused(format!(
                "cannot write to {path}: it is a file, and `{command}` fills a folder"
            ));
        }
        let is_run = folder.join("journal").is_dir();
        if let Some(owner) = owner(folder).or(is_run.then(|| Self::RUN.0.to_owned())) {
            return match owner == *command {
                true => Ok(()),
                false => refused(format!(
                    "{path} has the files of `{owner}`, which `{command}` would replace or mix with its own: name another folder"
                )),
            };
        }
        let results = FILES.into_iter().filter(|_| *command == Self::RUN.0);
        let names = files.split(' ').chain(results);
        let mut files = names.map(|name| folder.join(name));
        match files.find(|file| file.exists() && !folder.join(mark).exists()) {
            None => Ok(()),
            Some(file) => refused(format!(
                "{} was not written by `{command}`, which would replace it: name another folder, or move the file",
                file.display()
            )),
        }
    }
}

/// Returns the command that has filled a folder; `None` where it is unknown.
fn owner(folder: &Path) -> Option<String> {
    let owner = read_text(&folder.join(LOCK), SETTINGS).ok()?;
    Some(owner.trim().to_owned()).filter(|owner| !owner.is_empty())
}

/// Writes a page to a path that a user has named: into a new file, in the place of a file that
/// contains the mark of such pages, or to a FIFO or a device.
pub fn write_page(to: &Path, page: &str, mark: &str) -> Result<(), OutError> {
    let kind = fs::metadata(to).map(|it| it.file_type()).ok();
    if kind.is_some_and(|it| it.is_fifo() || it.is_char_device()) {
        let opened = OpenOptions::new().write(true).open(to);
        let written = opened.and_then(|mut file| file.write_all(page.as_bytes()));
        return written.map_err(unwritable(to));
    }
    let is_page = |text: String| text.is_empty() || text.contains(mark);
    if kind.is_some() && !read_text(to, 256 << 20).is_ok_and(is_page) {
        return Err(OutError::Refused(format!(
            "{} exists and is not a page of Gyre's own: name another file, or remove it",
            to.display()
        )));
    }
    // The target of a link is replaced, and not the link.
    let file = to.canonicalize().unwrap_or(to.to_owned());
    storage::write(&file, page).map_err(|error| unwritable(to)(error.source))
}

fn unwritable(path: &Path) -> impl Fn(io::Error) -> OutError {
    move |source| OutError::Refused(format!("cannot write to {}: {source}", path.display()))
}

/// Checks that the results in the folder of a run belong to its configuration.
pub fn require_results(run: &Path) -> Result<(), OutError> {
    match run.join(REPLACED).exists() {
        false => Ok(()),
        true => Err(OutError::Refused(format!(
            "the run in {} has not ended, and the results in it are of the run before: start the same command again, and it continues",
            run.display()
        ))),
    }
}

/// Why a path is invalid for the output of a command, or for results.
#[derive(Debug, Error)]
pub enum OutError {
    /// Another run, map or localisation is writing to it.
    #[error("{0}")]
    Held(String),
    #[error("{0}")]
    Refused(String),
}

/// The folder of the results, locked for this command while it lives.
#[derive(Debug)]
pub struct Out {
    path: PathBuf,
    lock: File,
}

/// Returns the full name of a folder of results, which need not exist yet.
pub fn absolute(out: &Path) -> io::Result<PathBuf> {
    out.canonicalize().or_else(|_| std::path::absolute(out))
}

/// A process that is being started has the file too until it executes its program, so that closing
/// it here would not end the lock.
impl Drop for Out {
    fn drop(&mut self) {
        let _ = self.lock.unlock();
    }
}

impl Out {
    pub fn lock(path: &Path) -> Result<Self, OutError> {
        Self::lock_for(path, Content::RUN)
    }

    /// Creates and locks the folder for this content. Nothing else in it is changed.
    pub fn lock_for(path: &Path, content: Content) -> Result<Self, OutError> {
        let unwritable = unwritable(path);
        content.require_place(path)?;
        create_folder(path).map_err(|error| unwritable(error.source))?;
        let path = path.canonicalize().map_err(&unwritable)?;
        match try_lock(&path.join(LOCK)).map_err(&unwritable)? {
            Attempt::Locked(mut lock) => {
                if owner(&path).is_none() {
                    lock.write_all(content.0.as_bytes()).map_err(&unwritable)?;
                }
                Ok(Self { path, lock })
            }
            Attempt::Held(holder) => {
                let holder = holder.map_or(String::new(), |holder| format!(", {holder}"));
                Err(OutError::Held(format!(
                    "another command is writing to {}{holder}: wait for it, or choose another --out",
                    path.display()
                )))
            }
        }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn join(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path.join(name)
    }
}
