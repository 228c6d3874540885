//! Observers of a run: the recorder, the page, viewers, shadows.

mod foxglove;
mod page;
pub mod record;
mod record_live;
mod record_parts;
mod shadow;
mod undisturbed;
