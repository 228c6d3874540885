//! Programs with typed ports, as in other languages, find the types for Gyre's bytes.

use std::fmt;

use gyre_contract::{
    Correction, Fix, Header, Item, Loop, Masked, Message, Motion, Objects, Pose, PoseHeader,
    Refined, Rotation, Scan,
};
use iceoryx2::{
    port::update_connections::UpdateConnections,
    prelude::{NodeBuilder, ZeroCopySend, ipc},
    service::port_factory::publish_subscribe::PortFactory,
};

use super::{Run, reader, send, writer};

type Typed<M> = PortFactory<ipc::Service, [TypedElement<M>], TypedHeader<M>>;

/// Defines a type of the bytes of a message, as another language has it.
macro_rules! typed {
    ($typed:ident, $bytes:ident, $wire:ident) => {
        #[repr(transparent)]
        struct $typed<M: Message>(M::$bytes);

        // SAFETY: plain data.
        unsafe impl<M: Message> ZeroCopySend for $typed<M> {
            unsafe fn type_name() -> &'static str {
                M::ENTRY.$wire.name
            }
        }

        impl<M: Message> fmt::Debug for $typed<M> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

typed!(TypedHeader, Header, header);
typed!(TypedElement, Element, element);

impl<M: Message> Default for TypedHeader<M> {
    fn default() -> Self {
        Self(bytemuck::Zeroable::zeroed())
    }
}

fn open<M: Message>(run: &Run) -> Typed<M> {
    let transport = run.manifest.transport().unwrap();
    let node = NodeBuilder::new().config(transport.config());
    let node = node.create::<ipc::Service>().unwrap();
    node.service_builder(&M::TOPIC.try_into().unwrap())
        .publish_subscribe::<[TypedElement<M>]>()
        .user_header::<TypedHeader<M>>()
        .open()
        .unwrap()
}

#[test]
fn a_typed_port_opens_every_topic() {
    let run = Run::begin();
    open::<Scan>(&run);
    open::<Masked>(&run);
    open::<Rotation>(&run);
    open::<Motion>(&run);
    open::<Refined>(&run);
    open::<Pose>(&run);
    open::<Loop>(&run);
    open::<Correction>(&run);
    open::<Fix>(&run);
    open::<Objects>(&run);
}

#[test]
fn a_typed_subscriber_receives_what_gyre_publishes() {
    let run = Run::begin();
    let typed = open::<Pose>(&run).subscriber_builder().create().unwrap();
    let poses = writer::<Pose>(&run.manifest);
    send(&poses, 7, 0);
    let sample = typed.receive().unwrap().unwrap();
    let header: &PoseHeader = &sample.user_header().0;
    assert_eq!((header.item.seq, header.x_m), (7, 0.0));
    assert_eq!(sample.payload().len(), 1);
}

#[test]
fn gyre_receives_what_a_typed_publisher_sends() {
    let run = Run::begin();
    let mut masked = reader::<Masked>(&run.manifest, None);
    let limits = &run.manifest.limits;
    let elements = (Masked::ENTRY.max_elements)(limits);
    let typed = open::<Masked>(&run);
    let publisher = typed.publisher_builder().initial_max_slice_len(elements);
    let publisher = publisher.create().unwrap();
    publisher.update_connections().unwrap();
    let mut sample = publisher.loan_slice_uninit(elements).unwrap();
    let header = &mut sample.user_header_mut().0;
    *header.item_mut() = Item::numbered(7);
    (header.n, header.rasters) = (limits.side() as u32, 1);
    header.cell_m = limits.cell_m;
    let sample = sample.write_from_fn(|block| TypedElement(bytemuck::cast([block as f32; 16])));
    sample.send().unwrap();
    let received = masked.head().unwrap().unwrap();
    let (header, values) = (received.header(), received.values::<f32>());
    assert_eq!((header.item.seq, header.n), (7, 10));
    let mut cells = values.iter().enumerate();
    assert!(cells.all(|(i, v)| *v == (i / 16) as f32));
    assert_eq!(values.len(), elements * 16);
}
