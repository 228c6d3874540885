//! The properties of the transport that this crate relies on, tested with real shared memory.

mod generations;
mod hand_over;
mod typed;
mod wake_up;
mod zero_copy;

use crate::rig::{Run, WINDOW, node, reader, send, writer};
