//! The drive that is played while the faults happen.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use tempfile::TempDir;

use crate::common::{Run, real_data, recording, runtime_is_installed};

/// The interval of the scans of all drives, s.
pub const PERIOD_S: f64 = 0.25;

/// A recording and the configuration of its runs.
pub struct Drive {
    recording: PathBuf,
    /// Scans of the recording.
    pub scans: usize,
    configured: fn() -> Run,
    /// The rate of its runs.
    pub rate: &'static str,
    undisturbed: OnceLock<Undisturbed>,
}

/// The results that must be the same: odometry, and what loop closing makes of it.
#[derive(Debug, PartialEq, Eq)]
pub struct Results([String; 4]);

/// A run that nothing disturbs.
pub struct Undisturbed {
    /// The results.
    pub results: Results,
    /// The size of its folder of results.
    pub bytes: u64,
    /// The shared memory that it announces.
    pub shared_memory_bytes: u64,
}

impl Results {
    /// The results of a run that is complete.
    pub fn of(run: &Run) -> Self {
        let names = [
            "odometry.csv",
            "trajectory.tum",
            "trajectory_slam.tum",
            "loops.csv",
        ];
        Self(names.map(|name| run.result(name)))
    }
}

impl Drive {
    /// A simulated recording without loops, in a second and a half.
    pub fn short() -> Self {
        Self {
            recording: recording::small().to_owned(),
            scans: recording::SCANS,
            configured: Run::small,
            rate: "4",
            undisturbed: OnceLock::new(),
        }
    }

    /// A simulated recording with loops, as fast as it goes.
    pub fn with_loops() -> Self {
        Self {
            recording: recording::around_a_block().to_owned(),
            scans: recording::SCANS_AROUND,
            configured: Run::small,
            rate: "max",
            undisturbed: OnceLock::new(),
        }
    }

    /// A RADIATE sequence with refinement and learned masks, where there is one.
    pub fn real() -> Option<Self> {
        let recording = real_data("radiate-2019-02-12").filter(|_| runtime_is_installed())?;
        let configured = || {
            let project = Path::new(crate::PROJECT);
            Run::of_file(&project.join("configs/radiate.toml"))
                .masked_by(&project.join("models/gyre-255.toml"))
        };
        Some(Self {
            scans: recording::images(&recording).len(),
            recording,
            configured,
            rate: "max",
            undisturbed: OnceLock::new(),
        })
    }

    /// A run of the drive, with results of its own.
    pub fn run(&self) -> Run {
        self.run_of(&self.recording, self.rate)
    }

    /// A run of another recording of the same kind, with SLAM.
    pub fn run_of(&self, recording: &Path, rate: &str) -> Run {
        let run = (self.configured)().data(recording).rate(rate);
        run.set("slam.kind=graph")
    }

    /// A run of the drive in so many seconds.
    pub fn run_in(&self, seconds: f64) -> Run {
        let rate = self.scans as f64 * PERIOD_S / seconds;
        self.run_of(&self.recording, &format!("{rate:.3}"))
    }

    /// A copy of the recording that may be damaged, with the images that are kept by their numbers.
    pub fn copy(&self, keep: impl Fn(usize) -> bool) -> TempDir {
        recording::linked(&self.recording, keep)
    }

    /// The run that nothing disturbs.
    pub fn undisturbed(&self) -> &Undisturbed {
        self.undisturbed.get_or_init(|| {
            let run = self.run();
            run.complete();
            let announced = run.summary()["shared_memory"]["segments"].clone();
            let segments = announced.as_array().unwrap().iter();
            Undisturbed {
                results: Results::of(&run),
                bytes: size(run.out()),
                shared_memory_bytes: segments.map(|segment| segment[1].as_u64().unwrap()).sum(),
            }
        })
    }
}

fn size(path: &Path) -> u64 {
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let below: u64 = entries.map(|entry| size(&entry.path())).sum();
    below + fs::metadata(path).map_or(0, |file| file.len())
}
