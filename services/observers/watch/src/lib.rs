//! A page that shows a run in a browser, and metrics for Prometheus; on request also topics for
//! Foxglove. The process is an observer: the run does not wait for it, and missed messages are
//! counted.
//!
//! `server` listens, the threads of `observing` write to the `run_view`, and a `stream` sends it to
//! one browser.

mod access;
mod connections;
mod delays;
mod foxglove;
mod histograms;
mod journal_track;
mod messages;
mod metrics;
mod observing;
mod page;
mod pictures;
mod processes;
mod recent_drift;
pub mod recorder;
mod run_view;
mod server;
mod stream;
mod track;

pub use access::Token;
pub use server::{Endpoint, Server};
