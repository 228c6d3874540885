//! `objects`: how many moving objects are around the vehicle.

use bytemuck::{Pod, Zeroable};

use crate::{
    block::FloatBlock,
    check::{Violation, require},
    follower::FollowerId,
    item::Item,
    limits::{History, Limits},
    message::{Message, Sender, header},
};

/// The objects at the time of a scan. Where they are is in `journal/objects.log`.
#[derive(Debug)]
pub enum Objects {}

impl Message for Objects {
    const TOPIC: &'static str = "objects";
    const SENDER: Sender = Sender::Follower(FollowerId::Objects);
    const READERS: usize = 0;
    const HISTORY: History = History::Latest;
    type Header = ObjectsHeader;
    type Element = FloatBlock;

    fn check_content(
        header: &Self::Header,
        _: &[Self::Element],
        _: &Limits,
    ) -> Result<(), Violation> {
        let fits = header.moving <= header.objects;
        require(fits, "moving", header.moving, "at most objects")
    }
}
header!(ObjectsHeader, "gyre_objects_header_v1");

/// The number of objects.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct ObjectsHeader {
    /// That of the scan's pose.
    pub item: Item,
    /// Objects that move, or did and stand now.
    pub objects: u64,
    /// Those that move.
    pub moving: u64,
}
