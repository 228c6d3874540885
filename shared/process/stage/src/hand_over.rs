//! One topic without a run around it, to measure the cost of handing over a message of any size.
//!
//! The messages pass through the same code as in a run: [`Writer`] in the sender,
//! [`Observer`](crate::observer::Observer) in each reader.

use std::path::Path;

use gyre_messages::{
    ByteBlock, History, Limits, Message, RotationHeader, Sender, StageId, Topic, TopicSizes,
    Violation, Window,
};

use crate::{
    Manifest, StageError,
    run::{RunRoot, close_to_others},
    services,
    transport::{self, Event, Node, Service},
    wake::Signals,
    writer::{Draft, Writer},
};

/// A message of [`Limits::scan_bytes`] bytes, whose content nobody checks.
#[derive(Debug)]
pub enum Parcel {}

impl Message for Parcel {
    const TOPIC: &'static str = "parcel";
    const SENDER: Sender = Sender::Stage(&[Self::HOP]);
    const READERS: usize = 0;
    const HISTORY: History = History::Latest;
    type Header = RotationHeader;
    type Element = ByteBlock;

    fn check_content(_: &Self::Header, _: &[Self::Element], _: &Limits) -> Result<(), Violation> {
        Ok(())
    }

    fn max_elements(limits: &Limits) -> usize {
        ByteBlock::count(limits.scan_bytes)
    }
}

impl Parcel {
    /// The hop that the sender stamps.
    pub const HOP: StageId = StageId::RadarReplay;
}

/// The sender of parcels. Readers attach with
/// [`ObservedRun::writing_to`](crate::observer::ObservedRun::writing_to).
pub struct HandOver {
    writer: Writer<Parcel>,
    sizes: TopicSizes,
    bytes: usize,
    // Dropped in this order: services, node, root.
    _topic: Service,
    _events: [Event; 2],
    _node: Node,
    _root: RunRoot,
}

impl HandOver {
    /// Creates the topic for parcels of so many bytes and so many readers, under the name of the
    /// folder `out`.
    pub fn create(out: &Path, bytes: usize, readers: usize) -> Result<Self, StageError> {
        transport::silence();
        let root = RunRoot::acquire(out, &Signals::install()?)
            .map_err(|e| StageError::transport("make a place for a topic", e))?;
        let manifest = manifest(&root, out, bytes, readers);
        manifest.write("")?;
        let node = manifest.transport()?.join("sender")?;
        close_to_others(&manifest.prefix)
            .map_err(|e| StageError::transport("close shared memory to other users", e))?;
        let sizes = Parcel::sizes(&manifest.window);
        let topic = Service::create(&node, &Topic::of::<Parcel>(), &manifest.window)?;
        let events = services::create_events(&node, Parcel::TOPIC, &sizes)?;
        Ok(Self {
            writer: Writer::open(&node, &manifest)?,
            sizes,
            bytes: Parcel::max_elements(&manifest.limits) * ByteBlock::LEN,
            _topic: topic,
            _events: events,
            _node: node,
            _root: root,
        })
    }

    /// Connects the readers that have attached.
    pub fn accept_readers(&self) -> Result<(), StageError> {
        self.writer.accept_readers()
    }

    /// Loans a parcel to fill in.
    pub fn loan(&self) -> Result<Draft<Parcel>, StageError> {
        self.writer.loan()
    }

    pub fn send(&self, draft: Draft<Parcel>) -> Result<(), StageError> {
        self.writer.send(draft, Parcel::HOP)
    }

    /// Returns the bytes of the topic's segment.
    pub fn shared_bytes(&self) -> usize {
        self.sizes.samples() * self.bytes
    }
}

fn manifest(root: &RunRoot, out: &Path, bytes: usize, readers: usize) -> Manifest {
    Manifest {
        prefix: root.prefix(),
        root: root.path().to_owned(),
        out: out.to_owned(),
        window: Window {
            scans: 1,
            lag: 0,
            look_back: 1,
            live_depth: 0,
            observers: readers,
            slam: false,
            localises: false,
            objects: false,
        },
        limits: Limits {
            scan_bytes: bytes,
            raster_cells: 0,
            cell_m: 1.0,
            rasters: 1,
            points: 0,
            samples: 0,
        },
        live: false,
        refines: false,
        rate: None,
        build: String::new(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::time::Duration;

    use super::*;
    use crate::observer::{Next, ObservedRun};

    #[test]
    fn every_reader_has_the_bytes_of_the_sender() {
        let out = tempfile::tempdir().unwrap();
        let sender = HandOver::create(out.path(), 1000, 3).unwrap();
        let runs = [0; 3].map(|_| ObservedRun::writing_to(out.path()).unwrap());
        let mut readers = runs.each_ref().map(|run| run.observe::<Parcel>().unwrap());
        sender.accept_readers().unwrap();
        let mut draft = sender.loan().unwrap();
        draft.header().item.seq = 7;
        draft.values::<u8>().fill(42);
        sender.send(draft).unwrap();
        for reader in &mut readers {
            let Next::Message(parcel, 0) = reader.next(Duration::from_secs(10)).unwrap() else {
                panic!("no parcel");
            };
            assert_eq!(parcel.item().seq, 7);
            assert_eq!(parcel.values::<u8>(), [42; 1024]);
        }
        assert!(
            ObservedRun::writing_to(out.path())
                .unwrap()
                .observe::<Parcel>()
                .is_err()
        );
    }
}
