//! The thread that sends traces to the collector.

use std::{
    sync::{
        Arc,
        atomic::Ordering,
        mpsc::{Receiver, RecvTimeoutError},
    },
    time::{Duration, Instant},
};

use serde_json::Value;
use ureq::Agent;

use super::{
    TraceCounts,
    spans::{Request, Trace},
};

/// The longest time that a trace waits for others.
const BATCH_PERIOD: Duration = Duration::from_secs(1);
/// Traces of one request: 1 MB.
const BATCH: usize = 128;
/// The longest time that a collector may take for a request.
const TIMEOUT: Duration = Duration::from_secs(3);
/// The shortest time between two sentences about failures.
const SENTENCE_PERIOD: Duration = Duration::from_secs(60);

/// Sends what is received.
pub(super) struct Sending {
    agent: Agent,
    endpoint: String,
    counts: Arc<TraceCounts>,
    say: fn(&str),
    /// The time of the last sentence about a failure; `None` while there is none.
    last_complaint: Option<Instant>,
}

impl Sending {
    pub fn new(endpoint: String, counts: Arc<TraceCounts>, say: fn(&str)) -> Self {
        let configuration = Agent::config_builder()
            .timeout_global(Some(TIMEOUT))
            .proxy(None)
            .user_agent(concat!("gyre/", env!("CARGO_PKG_VERSION")));
        Self {
            agent: configuration.build().into(),
            endpoint,
            counts,
            say,
            last_complaint: None,
        }
    }

    /// Sends until the other end is dropped, and then what is left.
    pub fn send_all(mut self, traces: &Receiver<Trace>) {
        while let Ok(first) = traces.recv() {
            let batch = gather(first, traces);
            match self.send(&batch) {
                Ok(answer) => self.count_sent(batch.len(), &answer),
                Err(error) => self.count_dropped(batch.len(), &error),
            }
        }
        let [sent, dropped] = self.counts.both();
        (self.say)(&format!(
            "{sent} traces were sent to {}, {dropped} dropped",
            self.endpoint
        ));
    }

    fn send(&self, batch: &[Trace]) -> Result<String, ureq::Error> {
        // Numbers and names always are JSON.
        let body = serde_json::to_vec(&Request::of(batch)).unwrap_or_default();
        let request = self.agent.post(&self.endpoint);
        let request = request.header("Content-Type", "application/json");
        request.send(&body)?.body_mut().read_to_string()
    }

    fn count_sent(&mut self, traces: usize, answer: &str) {
        let sent = &self.counts.sent;
        sent.fetch_add(traces as u64, Ordering::Relaxed);
        if let Some(reason) = rejected(answer) {
            (self.say)(&format!("{} takes not all spans: {reason}", self.endpoint));
        }
        if self.last_complaint.take().is_some() {
            let [_, dropped] = self.counts.both();
            (self.say)(&format!(
                "traces reach {} again; {dropped} were dropped",
                self.endpoint
            ));
        }
    }

    fn count_dropped(&mut self, traces: usize, error: &ureq::Error) {
        let dropped = &self.counts.dropped;
        let before = dropped.fetch_add(traces as u64, Ordering::Relaxed);
        if self
            .last_complaint
            .is_none_or(|at| at.elapsed() > SENTENCE_PERIOD)
        {
            self.last_complaint = Some(Instant::now());
            (self.say)(&format!(
                "traces do not reach {}: {error}; {} dropped so far, the rest goes on",
                self.endpoint,
                before + traces as u64
            ));
        }
    }
}

/// Waits for the rest of a batch.
fn gather(first: Trace, traces: &Receiver<Trace>) -> Vec<Trace> {
    let due = Instant::now() + BATCH_PERIOD;
    let mut batch = vec![first];
    while batch.len() < BATCH {
        match traces.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(trace) => batch.push(trace),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
        }
    }
    batch
}

/// Returns why a collector has rejected some of the spans, if it has.
fn rejected(answer: &str) -> Option<String> {
    let answer: Value = serde_json::from_str(answer).ok()?;
    let partial = answer.get("partialSuccess")?;
    // A number of 64 bits is a string in the JSON of protobuf, but not all write it so.
    let number = partial.get("rejectedSpans")?;
    let number = number.as_u64().or_else(|| number.as_str()?.parse().ok())?;
    let reason = partial.get("errorMessage").and_then(Value::as_str);
    let reason = reason.unwrap_or("it does not say why");
    (number > 0).then(|| format!("it has rejected {number}: {reason}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_collector_rejects_is_said_with_its_reason() {
        let reason = rejected(r#"{"partialSuccess":{"rejectedSpans":"3","errorMessage":"full"}}"#);
        assert_eq!(reason.as_deref(), Some("it has rejected 3: full"));
        for all_taken in ["", "{}", r#"{"partialSuccess":{"rejectedSpans":0}}"#] {
            assert_eq!(rejected(all_taken), None, "{all_taken}");
        }
    }
}
