//! A page that shows a run in a browser, and its metrics for Prometheus.
//!
//! The process is an observer: the run does not wait for it, and it counts what it misses. Reading order:
//!
//! 1. `server`: listens, and ends with a signal; `access`: who may read; `page`: the files of the page.
//! 2. `observing`: the threads that follow the run, and write what they see onto the `board`.
//! 3. `track`, `delays`, `pictures`, `processes`: what is kept of it, in bounded memory.
//! 4. `stream`: one browser, which receives `messages`; `metrics`: one scrape of Prometheus.

mod access;
mod board;
mod delays;
mod frame;
mod messages;
mod metrics;
mod observing;
mod page;
mod pictures;
mod processes;
mod server;
mod stream;
mod track;

pub use access::Token;
pub use server::{Server, WatchError};
