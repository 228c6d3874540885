//! A pose as the spans of a trace, as OTLP writes them in JSON.

use std::{fmt, ops::Range};

use gyre_messages::{Hop, Item, PoseHeader, StageId};
use gyre_stage::clock;
use serde::Serialize;
use sha2::{Digest, Sha256};

/// The kind of a span within one service.
const INTERNAL: u8 = 1;
/// The name of the span of a whole pose.
const ROOT: &str = "sensor to pose";

/// The times of a pose.
#[derive(Clone, Copy, Debug)]
pub struct Trace {
    id: u128,
    /// The number of the first span; those of the others follow.
    first_span: u64,
    /// The offset from `CLOCK_MONOTONIC` to the time since 1970, ns.
    since_1970_ns: i64,
    item: Item,
    stationary: bool,
}

/// The body of a request.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Request {
    resource_spans: [ResourceSpans; 1],
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct ResourceSpans {
    resource: Resource,
    scope_spans: [ScopeSpans; 1],
}

#[derive(Serialize)]
struct Resource {
    attributes: [Attribute; 2],
}

#[derive(Serialize)]
struct ScopeSpans {
    scope: Scope,
    spans: Vec<Span>,
}

#[derive(Serialize)]
struct Scope {
    name: &'static str,
    version: &'static str,
}

/// A span.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct Span {
    trace_id: String,
    span_id: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    parent_span_id: Option<String>,
    name: &'static str,
    kind: u8,
    /// Numbers of 64 bits are strings in the JSON of protobuf.
    start_time_unix_nano: String,
    end_time_unix_nano: String,
    attributes: Vec<Attribute>,
}

#[derive(Clone, Debug, Serialize)]
struct Attribute {
    key: &'static str,
    value: Value,
}

#[derive(Clone, Debug, Serialize)]
enum Value {
    #[serde(rename = "stringValue")]
    Text(String),
    #[serde(rename = "intValue")]
    Integer(String),
    #[serde(rename = "boolValue")]
    Bool(bool),
}

impl Attribute {
    fn text(key: &'static str, text: impl Into<String>) -> Self {
        let value = Value::Text(text.into());
        Self { key, value }
    }

    fn number(key: &'static str, number: impl fmt::Display) -> Self {
        let value = Value::Integer(number.to_string());
        Self { key, value }
    }
}

impl Request {
    /// Returns the request that sends these traces.
    pub fn of(traces: &[Trace]) -> Self {
        let service = Attribute::text("service.name", "gyre");
        let version = Attribute::text("service.version", env!("CARGO_PKG_VERSION"));
        let scope = Scope {
            name: "gyre",
            version: env!("CARGO_PKG_VERSION"),
        };
        let spans = traces.iter().flat_map(Trace::spans).collect();
        Self {
            resource_spans: [ResourceSpans {
                resource: Resource {
                    attributes: [service, version],
                },
                scope_spans: [ScopeSpans { scope, spans }],
            }],
        }
    }
}

impl Trace {
    /// Returns the trace of a pose of a run. The number depends on the run and the pose alone.
    pub fn of(run: &str, pose: &PoseHeader) -> Self {
        let seq = pose.item.seq.to_le_bytes();
        let digest: [u8; 32] = Sha256::digest([run.as_bytes(), &seq].concat()).into();
        let [id, first_span] = [0, 16].map(|first| {
            let bytes = digest.iter().skip(first).take(16);
            bytes.fold(0_u128, |number, byte| number << 8 | u128::from(*byte))
        });
        Self {
            id,
            first_span: first_span as u64,
            since_1970_ns: clock::since_1970_ns() - clock::now_ns(),
            item: pose.item,
            stationary: pose.motion.refinement.is_stationary(),
        }
    }

    /// Returns the span of the pose, one of each stage in it, and in each of these its parts.
    fn spans(&self) -> Vec<Span> {
        let mut spans = vec![self.root()];
        let mut before: Option<&Hop> = None;
        let stages = StageId::ALL.into_iter().zip(&self.item.hops);
        // Stages that the run does not have leave zeros.
        for (stage, hop) in stages.filter(|(_, hop)| **hop != Hop::default()) {
            let sent_ns = before.replace(hop).map(|before| before.published_ns);
            let first_ns = sent_ns.unwrap_or(hop.received_ns);
            let last_ns = hop.published_ns.max(hop.finished_ns);
            let number = spans.len() as u64;
            spans.push(self.span(spans.len(), Some(0), stage.name(), first_ns..last_ns));
            let parts = [
                ("transport", first_ns..hop.received_ns),
                ("wait", hop.received_ns..hop.started_ns),
                ("work", hop.started_ns..hop.finished_ns),
                ("publish", hop.finished_ns..last_ns),
            ];
            for (name, times) in parts {
                if name != "transport" || sent_ns.is_some() {
                    spans.push(self.span(spans.len(), Some(number), name, times));
                }
            }
        }
        spans
    }

    fn root(&self) -> Span {
        let item = &self.item;
        let end_ns = item.due_ns + item.sensor_to_pose_ns();
        Span {
            attributes: vec![
                Attribute::number("gyre.seq", item.seq),
                Attribute::number("gyre.scan", item.scan),
                Attribute::number("gyre.stamp_ns", item.stamp_ns),
                Attribute::number("gyre.dropped", item.dropped()),
                Attribute {
                    key: "gyre.stationary",
                    value: Value::Bool(self.stationary),
                },
            ],
            ..self.span(0, None, ROOT, item.due_ns..end_ns)
        }
    }

    fn span(&self, number: usize, parent: Option<u64>, name: &'static str, ns: Range<i64>) -> Span {
        let id = |number: u64| format!("{:016x}", self.first_span.wrapping_add(number));
        let time = |ns: i64| (ns + self.since_1970_ns).to_string();
        Span {
            trace_id: format!("{:032x}", self.id),
            span_id: id(number as u64),
            parent_span_id: parent.map(id),
            name,
            kind: INTERNAL,
            start_time_unix_nano: time(ns.start),
            end_time_unix_nano: time(ns.end.max(ns.start)),
            attributes: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn pose() -> PoseHeader {
        let mut pose = PoseHeader::default();
        let item = &mut pose.item;
        (item.seq, item.scan, item.published, item.due_ns) = (7, 9, 8, 500);
        let hop = |first: i64| Hop {
            received_ns: first,
            started_ns: first + 10,
            finished_ns: first + 110,
            published_ns: first + 115,
        };
        *item.hop_mut(StageId::RadarReplay) = hop(400);
        *item.hop_mut(StageId::Masking) = hop(600);
        *item.hop_mut(StageId::PoseIntegration) = hop(800);
        pose
    }

    #[test]
    fn the_parts_of_each_stage_add_up_to_its_span_and_the_root_is_the_latency() {
        let trace = Trace {
            since_1970_ns: 0,
            ..Trace::of("run", &pose())
        };
        let spans = trace.spans();
        let times = |span: &Span| -> [i64; 2] {
            [&span.start_time_unix_nano, &span.end_time_unix_nano].map(|time| time.parse().unwrap())
        };
        assert_eq!((spans[0].name, times(&spans[0])), (ROOT, [500, 910]));
        let named: Vec<_> = spans.iter().map(|span| span.name).collect();
        let parts = ["transport", "wait", "work", "publish"];
        assert_eq!(named[1..5], ["radar-replay", "wait", "work", "publish"]);
        assert_eq!(named[5], "masking");
        assert_eq!(named[6..10], parts);
        for (stage, expected) in [(1, [400, 515]), (5, [515, 715]), (10, [715, 915])] {
            let span = &spans[stage];
            assert_eq!(times(span), expected, "{}", span.name);
            assert_eq!(span.parent_span_id.as_ref(), Some(&spans[0].span_id));
            let is_part = |part: &&Span| part.parent_span_id.as_ref() == Some(&span.span_id);
            let parts: Vec<_> = spans.iter().filter(is_part).map(times).collect();
            assert_eq!(parts[0][0], expected[0]);
            assert_eq!(parts[parts.len() - 1][1], expected[1]);
            assert!(parts.windows(2).all(|pair| pair[0][1] == pair[1][0]));
        }
    }

    #[test]
    fn a_pose_has_one_trace_and_no_other_has_its_number() {
        let of = |run: &str, seq: u64| {
            let mut pose = pose();
            pose.item.seq = seq;
            let spans = Trace::of(run, &pose).spans();
            (spans[0].trace_id.clone(), spans[0].span_id.clone())
        };
        assert_eq!(of("a", 1), of("a", 1));
        assert_ne!(of("a", 1).0, of("a", 2).0);
        assert_ne!(of("a", 1).0, of("b", 1).0);
        assert_eq!((of("a", 1).0.len(), of("a", 1).1.len()), (32, 16));
    }
}
