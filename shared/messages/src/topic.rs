//! What makes a type a message.

use std::fmt::Debug;

use bytemuck::Pod;
use iceoryx2::prelude::ZeroCopySend;

use crate::item::Item;

/// All topics, in the order of the stream.
pub const TOPICS: [&str; 6] = ["scan", "masked", "rotation", "motion", "refined", "pose"];

/// A fixed header that starts with an [`Item`].
pub trait Header: ZeroCopySend + Default + Debug + 'static {
    /// Which scan this is about.
    fn item(&self) -> &Item;
    /// Which scan this is about, to fill in.
    fn item_mut(&mut self) -> &mut Item;
}

/// A topic's contract: its name, its header and its payload's elements.
pub trait Message: 'static {
    /// The topic's name, one of [`TOPICS`].
    const TOPIC: &'static str;
    /// What comes with each message.
    type Header: Header;
    /// What the payload is a slice of.
    type Element: ZeroCopySend + Pod + Debug;
}

macro_rules! message {
    ($(#[$doc:meta])* $name:ident, $topic:literal, $header:ty, $element:ty) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub enum $name {}

        impl $crate::Message for $name {
            const TOPIC: &'static str = $topic;
            type Header = $header;
            type Element = $element;
        }
    };
}
pub(crate) use message;

/// Apart from [`message!`], for two messages may have the same header.
macro_rules! header {
    ($header:ty) => {
        impl $crate::Header for $header {
            fn item(&self) -> &$crate::Item {
                &self.item
            }
            fn item_mut(&mut self) -> &mut $crate::Item {
                &mut self.item
            }
        }
    };
}
pub(crate) use header;
