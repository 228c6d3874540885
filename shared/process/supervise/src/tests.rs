//! Shared by the tests of several parts: a plan that is never started.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_contract::{FollowerId, Limits, StageId, Window};
use gyre_transport::Manifest;

use crate::{Plan, StagePlan};

/// The processes of [`plan`].
pub(crate) const SOURCE: usize = 0;
pub(crate) const MASKING: usize = 1;
pub(crate) const REFINEMENT: usize = 2;
pub(crate) const FOLLOWER: usize = 3;

pub(crate) const LIMIT: Duration = Duration::from_secs(5);

pub(crate) fn manifest(out: &Path) -> Manifest {
    Manifest {
        root: out.to_owned(),
        out: out.to_owned(),
        window: Window {
            scans: 2,
            lag: 1,
            look_back: 1,
            observers: 2,
            ..Window::default()
        },
        limits: Limits {
            scan_bytes: 1000,
            raster_cells: 100,
            cell_m: 1.0,
            rasters: 1,
            ..Limits::default()
        },
        ..Manifest::default()
    }
}

/// A plan of three stages and a follower, in a folder that does not exist.
pub(crate) fn plan() -> Plan {
    let stages = [
        StageId::RadarReplay.name(),
        StageId::Masking.name(),
        StageId::Refinement.name(),
        FollowerId::LoopClosure.name(),
    ];
    Plan {
        manifest: manifest(&PathBuf::from("/nonexistent")),
        stages: stages
            .map(|name| StagePlan::new(name, vec!["true".to_owned()]))
            .into(),
        recorder: None,
        guardian: Vec::new(),
        stall_timeout: Some(LIMIT),
        start_timeout: None,
        cpu_wake_us: None,
        takes_commands: true,
    }
}
