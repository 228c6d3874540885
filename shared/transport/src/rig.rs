//! A run without processes, for tests of the transport and of what uses it.

#![allow(clippy::unwrap_used)]

use std::rc::Rc;

use gyre_contract::{Item, Limits, Message, Pose, StageId, Window};
use tempfile::TempDir;

use crate::{
    Manifest,
    reader::{Port, Reader},
    run::RunRoot,
    services::Services,
    transport::Node,
    wake::Signals,
    writer::Writer,
};

pub const WINDOW: Window = Window {
    scans: 2,
    lag: 1,
    look_back: 1,
    live_depth: 0,
    observers: 2,
    slam: true,
    localises: true,
    objects: true,
};

/// A run without processes: its services, and nodes for tests. Runs are isolated from each other.
pub struct Run {
    pub manifest: Manifest,
    _services: Services,
    _supervisor: Node,
    // Last: removes all files of the run.
    _root: RunRoot,
    _out: Rc<TempDir>,
}

impl Run {
    pub fn begin() -> Self {
        Self::writing_to(&Rc::new(tempfile::tempdir().unwrap()))
    }

    pub fn writing_to(out: &Rc<TempDir>) -> Self {
        let root = RunRoot::acquire(out.path(), &Signals::install().unwrap()).unwrap();
        let manifest = Manifest {
            prefix: root.prefix(),
            root: root.path().to_owned(),
            out: out.path().to_owned(),
            window: WINDOW,
            limits: Limits {
                scan_bytes: 1000,
                raster_cells: 100,
                cell_m: 1.0,
                rasters: 1,
                ..Limits::default()
            },
            ..Manifest::default()
        };
        manifest.write("").unwrap();
        let supervisor = node(&manifest);
        let services = Services::create(&supervisor, &manifest.window).unwrap();
        Self {
            manifest,
            _services: services,
            _supervisor: supervisor,
            _root: root,
            _out: Rc::clone(out),
        }
    }
}

pub fn node(manifest: &Manifest) -> Node {
    manifest.transport().unwrap().join("test").unwrap()
}

pub fn writer<M: Message>(manifest: &Manifest) -> Writer<M> {
    Writer::open(&node(manifest), manifest).unwrap()
}

pub fn reader<M: Message>(manifest: &Manifest, next: Option<u64>) -> Reader<M> {
    Reader::of(Port::open(&node(manifest), manifest).unwrap(), next)
}

/// A pose is the smallest message.
pub fn send(poses: &Writer<Pose>, seq: u64, flags: u32) {
    let mut draft = poses.loan().unwrap();
    draft.header().item = Item::numbered(seq).flagged(flags);
    poses.send(draft, StageId::PoseIntegration).unwrap();
}
