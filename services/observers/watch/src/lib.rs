//! A page that shows a run in a browser, and metrics for Prometheus; on request also topics for
//! Foxglove.
//!
//! The process is an observer: the run does not wait for it, and missed messages are counted.
//! Reading order:
//!
//! 1. `server`: listens, and ends with a signal; `connections`: how many at once; `access`: who may
//!    read; `page`: the files of the page.
//! 2. `observing`: the threads that follow the run, and write to the `run_view`.
//! 3. `track`, `delays`, `pictures`, `processes`: the parts of the view, in bounded memory.
//! 4. `stream`: one browser, which receives `messages`; `metrics`: one scrape of Prometheus.
//! 5. `foxglove`: the topics for Foxglove.

mod access;
mod connections;
mod delays;
mod foxglove;
mod frame;
mod histograms;
mod journal_track;
mod messages;
mod metrics;
mod observing;
mod page;
mod pictures;
mod processes;
mod recent_drift;
mod run_view;
mod server;
mod stream;
mod track;

pub use access::Token;
pub use server::{Endpoint, Server, WatchError};
