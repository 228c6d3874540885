//! What must hold before the first process is started.

use std::{path::Path, time::Duration};

use gyre_masking::{MaskKind, Masker, model::Card};
use gyre_messages::{Footprint, Limits, Window};
use gyre_radar::Dataset;
use gyre_simulator::SimulatedDrive;
use thiserror::Error;

use crate::{configuration::Configuration, print};

const SHARED_MEMORY: &str = "/dev/shm";

/// Why a run cannot start.
#[derive(Debug, Error)]
pub enum PreflightError {
    /// Nothing to play.
    #[error(
        "no dataset is named: give its folder with --data, or as source.data in the configuration, or have one simulated by a section [simulation]"
    )]
    NoData,
    /// One scan makes no motion.
    #[error("{path} has {scans} scan{}: a motion is between two, so there is nothing to run; `gyre inspect` shows what is there", if *scans == 1 { "" } else { "s" })]
    TooFew {
        /// The dataset.
        path: String,
        /// What it has.
        scans: usize,
    },
    /// The segments would not fit.
    #[error(
        "shared memory at /dev/shm has {free_mb:.1} MB free, but the run needs {footprint}: enlarge it (containers: --shm-size), \
         or lower run.window or raster.n"
    )]
    SharedMemory {
        /// What is there.
        free_mb: f64,
        /// What it takes.
        footprint: Footprint,
    },
    /// It cannot even be asked.
    #[error("cannot use shared memory at /dev/shm: {0}")]
    NoSharedMemory(rustix::io::Errno),
}

/// What the dataset and the machine allow.
pub struct Preflight {
    /// Scans to play.
    pub scans: usize,
    /// How much may be on its way.
    pub window: Window,
    /// The largest payloads.
    pub limits: Limits,
    /// Shared memory that the run takes.
    pub footprint: Footprint,
    /// `ground_truth.tum` of a simulation that is played without being stored.
    pub truth: Option<Vec<u8>>,
}

/// Looks at the dataset and at the machine.
pub fn check(configuration: &Configuration) -> Result<Preflight, crate::Failure> {
    let Played { dataset, truth } = open(configuration)?;
    let scans = configuration.played(dataset.len()).len();
    if scans < 2 {
        return Err(PreflightError::TooFew {
            path: configuration.data(),
            scans,
        }
        .into());
    }
    let masker = Masker::new(
        &configuration.raster,
        &configuration.points,
        &configuration.masking,
    )?;
    let window = configuration.window(period(dataset.as_ref()), masker.scans());
    let limits = Limits {
        scan_bytes: dataset.limits().bytes,
        raster_cells: configuration.raster.n * configuration.raster.n,
        rasters: masker.scans(),
        points: configuration.points.capacity,
    };
    let footprint = Footprint::new(&window, &limits);
    check_shared_memory(&footprint)?;
    Ok(Preflight {
        scans,
        window,
        limits,
        footprint,
        truth,
    })
}

/// Tells where a configuration differs from what its network was trained for.
pub fn warn_of_training(configuration: &Configuration) -> Result<(), crate::Failure> {
    let Configuration {
        masking, raster, ..
    } = configuration;
    if masking.kind == MaskKind::Learned {
        let unlike = Card::read(masking)?.training_mismatches(masking, raster);
        if let (false, Some(card)) = (unlike.is_empty(), &masking.model) {
            print::note(format!(
                "the masks of {} may be worth less than they were made for: {}",
                card.display(),
                unlike.join(", ")
            ));
        }
    }
    Ok(())
}

/// What is to be played.
pub struct Played {
    /// Its scans.
    pub dataset: Box<dyn Dataset>,
    /// `ground_truth.tum` of a simulation that is played without being stored.
    pub truth: Option<Vec<u8>>,
}

/// Opens what is to be played: a recording, or a simulation.
pub fn open(configuration: &Configuration) -> Result<Played, crate::Failure> {
    let (data, options) = (&configuration.source.data, &configuration.dataset);
    if let Some(simulation) = configuration.streamed() {
        let drive = SimulatedDrive::new(simulation)?;
        let truth = Some(drive.ground_truth_tum());
        return Ok(Played {
            dataset: drive.open(options)?,
            truth,
        });
    }
    match data.as_os_str().is_empty() {
        true => Err(PreflightError::NoData.into()),
        false => Ok(Played {
            dataset: gyre_radar::open(data, options)?,
            truth: None,
        }),
    }
}

fn period(dataset: &dyn Dataset) -> Option<Duration> {
    let last = dataset.len().checked_sub(1).filter(|last| *last > 0)?;
    let span_ns = dataset.nominal_stamp_ns(last)? - dataset.nominal_stamp_ns(0)?;
    Some(Duration::from_nanos((span_ns.max(0) as u64) / last as u64))
}

/// Writing to a full tmpfs kills a process without a word, so see to it before.
fn check_shared_memory(footprint: &Footprint) -> Result<(), PreflightError> {
    let there =
        rustix::fs::statvfs(Path::new(SHARED_MEMORY)).map_err(PreflightError::NoSharedMemory)?;
    let free = there.f_bavail as f64 * there.f_frsize as f64;
    match free >= footprint.total() as f64 {
        true => Ok(()),
        false => Err(PreflightError::SharedMemory {
            free_mb: free / 1e6,
            footprint: footprint.clone(),
        }),
    }
}
