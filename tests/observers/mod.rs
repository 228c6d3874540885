//! Observers of a run: the recorder, the page, viewers, traces, shadows.

mod foxglove;
mod page;
mod record;
mod shadow;
mod traces;
mod undisturbed;
