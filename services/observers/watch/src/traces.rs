//! A trace of each pose for a collector of OpenTelemetry (OTLP over HTTP, in JSON).
//!
//! Each item carries the times at which every stage received, began, finished and published it, so
//! a trace needs nothing of the stages. Traces wait in a queue of bounded length for the thread
//! that sends them: those that a collector does not take are dropped and counted.
//!
//! Reading order: `spans` (a pose as spans), `sending` (the thread).

mod sending;
mod spans;

use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{self, SyncSender},
    },
    thread::{self, JoinHandle},
};

use axum::http::{Uri, uri::Scheme};
use gyre_messages::PoseHeader;
use thiserror::Error;

use sending::Sending;
use spans::Trace;

/// Traces that wait at most: half a minute of the fastest radar, or four seconds of a recording at
/// 500 scans/s. They take 700 kB.
const QUEUE: usize = 2048;
/// The path of traces at a collector.
const PATH: &str = "/v1/traces";

/// A failure of the start.
#[derive(Debug, Error)]
pub enum TraceError {
    /// The address is none of a collector.
    #[error(
        "{0} is no address of a collector: name one as http://127.0.0.1:4318, where a collector receives OTLP over HTTP"
    )]
    Address(String),
    /// The address needs TLS.
    #[error(
        "{0} needs TLS, which Gyre has not: send to a collector of this machine by http://, which forwards by https://"
    )]
    Tls(String),
    /// The system refuses a thread.
    #[error("cannot send traces: {0}")]
    Thread(#[from] std::io::Error),
}

/// Sends a trace of each pose. Dropped, it sends what waits.
pub struct Exporter {
    /// `None` at the end.
    traces: Option<SyncSender<Trace>>,
    counts: Arc<TraceCounts>,
    thread: Option<JoinHandle<()>>,
}

/// The counts of traces.
#[derive(Debug, Default)]
pub struct TraceCounts {
    /// Traces that the collector has taken.
    pub sent: AtomicU64,
    /// Traces that did not fit into the queue, or that the collector has not taken.
    pub dropped: AtomicU64,
}

impl Exporter {
    /// Sends to the collector at a URL. `say` prints a sentence when that fails.
    ///
    /// # Errors
    /// The URL is none of HTTP, or the system refuses a thread.
    pub fn start(url: &str, say: fn(&str)) -> Result<Self, TraceError> {
        let counts = Arc::new(TraceCounts::default());
        let (sender, receiver) = mpsc::sync_channel(QUEUE);
        let sending = Sending::new(endpoint(url)?, Arc::clone(&counts), say);
        let thread = thread::Builder::new().name("traces".to_owned());
        let thread = thread.spawn(move || sending.send_all(&receiver))?;
        Ok(Self {
            traces: Some(sender),
            counts,
            thread: Some(thread),
        })
    }

    /// Sends a pose of a run. It does not wait.
    pub fn add(&self, run: &str, pose: &PoseHeader) {
        let is_taken = self
            .traces
            .as_ref()
            .is_some_and(|traces| traces.try_send(Trace::of(run, pose)).is_ok());
        if !is_taken {
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Returns the counts, which continue.
    pub fn counts(&self) -> Arc<TraceCounts> {
        Arc::clone(&self.counts)
    }
}

impl TraceCounts {
    /// Returns the numbers of traces sent and dropped.
    pub fn both(&self) -> [u64; 2] {
        [&self.sent, &self.dropped].map(|count| count.load(Ordering::Relaxed))
    }
}

impl Drop for Exporter {
    fn drop(&mut self) {
        self.traces = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Returns where a collector at this URL receives traces.
fn endpoint(url: &str) -> Result<String, TraceError> {
    let uri: Option<Uri> = url.parse().ok();
    let uri = uri.filter(|uri| uri.authority().is_some() && uri.query().is_none());
    match uri.as_ref().and_then(Uri::scheme) {
        Some(scheme) if *scheme == Scheme::HTTP => {}
        Some(scheme) if *scheme == Scheme::HTTPS => return Err(TraceError::Tls(url.to_owned())),
        _ => return Err(TraceError::Address(url.to_owned())),
    }
    let base = url.trim_end_matches('/');
    Ok(match base.ends_with(PATH) {
        true => base.to_owned(),
        false => format!("{base}{PATH}"),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_path_of_traces_is_added_to_the_address_of_a_collector() {
        for url in [
            "http://robot:4318",
            "http://robot:4318/",
            "http://robot:4318/v1/traces",
        ] {
            assert_eq!(endpoint(url).unwrap(), "http://robot:4318/v1/traces");
        }
        assert!(matches!(endpoint("https://robot"), Err(TraceError::Tls(_))));
        for wrong in [
            "robot:4318",
            "robot",
            "grpc://robot:4317",
            "http://robot?a=b",
            "",
        ] {
            let refused = endpoint(wrong);
            assert!(matches!(refused, Err(TraceError::Address(_))), "{wrong}");
        }
    }

    #[test]
    fn without_a_collector_traces_are_dropped_and_counted() {
        // A port at which nobody listens: others take theirs on 127.0.0.1.
        let free = std::net::TcpListener::bind("127.0.0.2:0").unwrap();
        let url = format!("http://{}", free.local_addr().unwrap());
        drop(free);
        let exporter = Exporter::start(&url, |_| {}).unwrap();
        let counts = exporter.counts();
        let many = 3 * QUEUE as u64;
        (0..many).for_each(|_| exporter.add("run", &PoseHeader::default()));
        drop(exporter);
        assert_eq!(counts.both(), [0, many]);
    }
}
