//! Measurements without a schema of Foxglove, as JSON with a schema of its own, to plot.

use std::collections::BTreeMap;

use gyre_contract::{Item, StageId};
use serde_json::{Value, json};

pub const LATENCY: &str = "/latency";
/// The channel of the report that the page shows once a second.
pub const HEALTH: &str = "/health";

/// Returns the delays of a pose. The names of stages have `_` for `-`: paths of plots have no
/// hyphens.
pub fn latency(item: &Item) -> Vec<u8> {
    let ms = |duration_ns: i64| duration_ns as f64 * 1e-6;
    let hops = item.hop_times().map(|times| {
        let hop = json!({
            "transport_ms": ms(times.transport_ns.unwrap_or(0)),
            "wait_ms": ms(times.wait_ns),
            "work_ms": ms(times.work_ns),
        });
        (key(times.stage), hop)
    });
    let latency = json!({
        "seq": item.seq,
        "scan": item.scan,
        "dropped": item.dropped(),
        "sensor_to_pose_ms": ms(item.sensor_to_pose_ns()),
        "stages": hops.collect::<BTreeMap<_, _>>(),
    });
    latency.to_string().into()
}

fn key(stage: StageId) -> String {
    stage.name().replace('-', "_")
}

pub fn latency_schema() -> Value {
    let hop = object(numbers(["transport_ms", "wait_ms", "work_ms"]));
    let stages = StageId::ALL.map(|stage| (key(stage), hop.clone()));
    let own = numbers(["seq", "scan", "dropped", "sensor_to_pose_ms"]);
    object(own.chain([("stages".to_owned(), object(stages))]))
}

pub fn health_schema() -> Value {
    let counts = ["published", "poses", "dropped", "in_flight"];
    let missed = object(numbers(["pose", "scan", "masked", "objects"]));
    let words = ["name", "state"].map(|name| (name.to_owned(), json!({"type": "string"})));
    let usage = ["pid", "restarts", "processor_share", "cpu_s", "own_bytes"];
    let process = words.into_iter().chain(numbers(usage));
    let processes = json!({"type": "array", "items": object(process)});
    let own = numbers(counts).chain(numbers(["scans_per_s", "distance_m"]));
    let lists = [("missed", missed), ("processes", processes)];
    object(own.chain(lists.map(|(name, schema)| (name.to_owned(), schema))))
}

fn numbers<const N: usize>(names: [&str; N]) -> impl Iterator<Item = (String, Value)> + use<N> {
    names
        .map(|name| (name.to_owned(), json!({"type": "number"})))
        .into_iter()
}

fn object(properties: impl IntoIterator<Item = (String, Value)>) -> Value {
    let properties: serde_json::Map<_, _> = properties.into_iter().collect();
    json!({"type": "object", "properties": properties})
}
