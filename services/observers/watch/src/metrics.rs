//! The metrics of the run, in the text formats of Prometheus.

use std::{collections::BTreeMap, fmt};

use prometheus_client::{
    collector::Collector,
    encoding::{DescriptorEncoder, EncodeMetric, text::encode},
    metrics::{MetricType, counter::ConstCounter, gauge::ConstGauge, info::Info},
    registry::{Registry, Unit},
};

use crate::{board::Board, messages::Counts, processes::Process};

/// The type of the newer format, of which Prometheus says that it takes it.
const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
const TEXT: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Counts and states at the time of a scrape.
#[derive(Debug)]
struct Snapshot {
    is_up: bool,
    counts: Counts,
    processes: Vec<Process>,
    /// Traces that were sent and dropped, where they were asked for.
    traces: Option<[u64; 2]>,
}

/// Returns the type of the answer and its text: OpenMetrics for one who accepts it, else the older format.
pub fn scrape(board: &Board, accepted: &[u8]) -> (&'static str, String) {
    let text = open_metrics(board);
    let takes_open_metrics =
        String::from_utf8_lossy(accepted).contains("application/openmetrics-text");
    match takes_open_metrics {
        true => (OPEN_METRICS, text),
        false => (TEXT, older(&text)),
    }
}

fn open_metrics(board: &Board) -> String {
    let mut registry = Registry::with_prefix("gyre");
    let run = board.run();
    let labels = vec![
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("out", run.out),
    ];
    registry.register("run", "The run that is watched", Info::new(labels));
    registry.register_with_unit(
        "sensor_to_pose",
        "Time from the complete sweep to its pose",
        Unit::Seconds,
        board.histograms.sensor_to_pose.clone(),
    );
    registry.register_with_unit(
        "hop",
        "Time of a scan at each stage: transport from the stage before, wait, work",
        Unit::Seconds,
        board.histograms.hops.clone(),
    );
    registry.register_collector(Box::new(Snapshot {
        is_up: run.state.is_up(),
        counts: board.counts(),
        processes: board.processes(),
        traces: board.traces.get().map(|counts| counts.both()),
    }));
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = encode(&mut text, &registry);
    text
}

/// Returns the same in the older format, where the name of a counter has its `_total` everywhere, and an info is a gauge.
fn older(text: &str) -> String {
    let kind = |line: &'_ str| -> Option<(String, &'static str)> {
        let (name, kind) = line.strip_prefix("# TYPE ")?.split_once(' ')?;
        let suffix = match kind {
            "counter" => "_total",
            "info" => "_info",
            _ => return None,
        };
        Some((name.to_owned(), suffix))
    };
    let renamed: BTreeMap<String, &str> = text.lines().filter_map(kind).collect();
    let mut older = String::with_capacity(text.len());
    for line in text.lines() {
        let mut words = line.splitn(4, ' ');
        let words = [(); 4].map(|()| words.next().unwrap_or_default());
        match words {
            ["#", "EOF" | "UNIT", ..] => continue,
            ["#", what @ ("HELP" | "TYPE"), name, rest] if renamed.contains_key(name) => {
                let rest = if (what, rest) == ("TYPE", "info") {
                    "gauge"
                } else {
                    rest
                };
                older.push_str(&format!("# {what} {name}{} {rest}", renamed[name]));
            }
            _ => older.push_str(line),
        }
        older.push('\n');
    }
    older
}

impl Collector for Snapshot {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        self.encode_counts(&mut encoder)?;
        self.encode_missed(&mut encoder)?;
        self.encode_received(&mut encoder)?;
        self.encode_processes(&mut encoder)
    }
}

impl Snapshot {
    fn encode_counts(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let counts = &self.counts;
        let counters = [
            (
                "scans_published",
                "Scans that the source has published.",
                counts.published,
            ),
            ("poses", "Poses of the trajectory.", counts.poses),
            (
                "scans_dropped",
                "Scans that live mode has dropped.",
                counts.dropped,
            ),
        ];
        let traces = self.traces.into_iter().flat_map(|[sent, dropped]| {
            [
                ("traces_sent", "Traces that the collector has taken.", sent),
                (
                    "traces_dropped",
                    "Traces that the collector has not taken.",
                    dropped,
                ),
            ]
        });
        for (name, help, count) in counters.into_iter().chain(traces) {
            let counter = ConstCounter::new(count);
            counter.encode(encoder.encode_descriptor(
                name,
                help,
                None,
                counter.metric_type(),
            )?)?;
        }
        let gauges = [
            ("up", "1 while a run works, else 0.", u64::from(self.is_up)),
            (
                "scans_in_flight",
                "Scans that were published and have no pose yet.",
                counts.in_flight,
            ),
        ];
        for (name, help, value) in gauges {
            let gauge = ConstGauge::new(value);
            gauge.encode(encoder.encode_descriptor(name, help, None, gauge.metric_type())?)?;
        }
        Ok(())
    }

    fn encode_missed(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let help = "Messages that this observer has missed. Delays lack those of missed poses.";
        let missed = &self.counts.missed;
        let mut family =
            encoder.encode_descriptor("observer_missed", help, None, MetricType::Counter)?;
        let topics = [
            ("pose", missed.pose),
            ("scan", missed.scan),
            ("masked", missed.masked),
        ];
        for (topic, count) in topics {
            ConstCounter::new(count).encode(family.encode_family(&[("topic", topic)])?)?;
        }
        Ok(())
    }

    /// Encodes what a live radar has not delivered, if the source receives one.
    fn encode_received(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let Some(received) = self.processes.iter().find_map(|it| it.received) else {
            return Ok(());
        };
        let counters = [
            (
                "radar_scans_left_out",
                "Turns of the radar of which there is no scan.",
                received.scans_left_out,
            ),
            (
                "radar_missing_azimuths",
                "Azimuths that are missing from the scans.",
                received.missing_azimuths,
            ),
            (
                "radar_damaged_messages",
                "Messages of the radar that could not be read.",
                received.damaged_messages,
            ),
            (
                "radar_foreign_messages",
                "Datagrams of others, and descriptions that do not fit into the run.",
                received.foreign_messages,
            ),
            (
                "radar_reconnections",
                "Connections to the radar after the first.",
                received.reconnections(),
            ),
        ];
        for (name, help, count) in counters {
            let counter = ConstCounter::new(count);
            counter.encode(encoder.encode_descriptor(
                name,
                help,
                None,
                counter.metric_type(),
            )?)?;
        }
        let gauge = ConstGauge::new(u64::from(received.is_receiving));
        let help = "1 while azimuths arrive from the radar, else 0.";
        gauge.encode(encoder.encode_descriptor(
            "radar_receiving",
            help,
            None,
            gauge.metric_type(),
        )?)
    }

    fn encode_processes(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        type Value = fn(&Process) -> Option<f64>;
        let families: [(&str, &str, Option<Unit>, MetricType, Value); 3] = [
            (
                "process_restarts",
                "Restarts of a process of the run.",
                None,
                MetricType::Counter,
                |process| Some(process.restarts as f64),
            ),
            (
                "process_cpu",
                "Processor time of a process since its start.",
                Some(Unit::Seconds),
                MetricType::Counter,
                |process| process.cpu_s,
            ),
            (
                "process_memory",
                "Memory of a process's own.",
                Some(Unit::Bytes),
                MetricType::Gauge,
                |process| process.own_bytes.map(|bytes| bytes as f64),
            ),
        ];
        for (name, help, unit, kind, value) in families {
            let mut family = encoder.encode_descriptor(name, help, unit.as_ref(), kind)?;
            for process in &self.processes {
                let labels = [("process", process.name.as_str())];
                let of_process = family.encode_family(&labels)?;
                match (value(process), kind) {
                    (None, _) => {}
                    (Some(value), MetricType::Counter) => {
                        ConstCounter::new(value).encode(of_process)?;
                    }
                    (Some(value), _) => ConstGauge::new(value).encode(of_process)?,
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use gyre_messages::{Hop, Item, StageId};
    use gyre_stage::source::Received;

    use super::*;

    fn board() -> Board {
        let board = Board::new("/a folder/\"quoted\"");
        let mut item = Item::default();
        for stage in [StageId::Masking, StageId::PoseIntegration] {
            *item.hop_mut(stage) = Hop {
                received_ns: 1_000_000,
                started_ns: 2_000_000,
                finished_ns: 5_000_000,
                published_ns: 6_000_000,
            };
        }
        board.histograms.add(&item);
        board
    }

    /// The families that a text describes, and the names of its samples.
    fn families(text: &str) -> BTreeMap<&str, &str> {
        let types = text.lines().filter_map(|line| line.strip_prefix("# TYPE "));
        types.filter_map(|line| line.split_once(' ')).collect()
    }

    #[test]
    fn each_sample_of_the_older_format_is_of_a_family_with_a_type_and_a_help() {
        let (kind, text) = scrape(&board(), b"text/plain");
        assert_eq!(kind, TEXT);
        let families = families(&text);
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let name = line.split(['{', ' ']).next().unwrap_or_default();
            let of_histogram = ["_bucket", "_sum", "_count"]
                .iter()
                .find_map(|suffix| name.strip_suffix(suffix));
            let family = of_histogram.unwrap_or(name);
            assert!(families.contains_key(family), "{line}");
            assert!(text.contains(&format!("# HELP {family} ")), "{line}");
            let value = line.rsplit(' ').next().map(str::parse::<f64>);
            assert!(matches!(value, Some(Ok(_))), "{line}");
        }
        for (name, kind) in families {
            assert_eq!(name.ends_with("_total"), kind == "counter", "{name}");
            assert!(
                name.starts_with("gyre_") && !name.starts_with("gyre_gyre"),
                "{name}"
            );
        }
        let delays = "gyre_hop_seconds_sum{stage=\"masking\",part=\"work\"} 0.003";
        assert!(text.contains(delays), "{text}");
    }

    #[test]
    fn what_a_radar_has_not_delivered_is_counted() {
        let received = Received {
            missing_azimuths: 3,
            scans_left_out: 5,
            connections: 8,
            is_receiving: true,
            ..Received::default()
        };
        let source = Process {
            name: "radar-replay".to_owned(),
            pid: 1,
            state: "waiting",
            level: "good",
            restarts: 0,
            last_death: None,
            received: Some(received),
            processor_share: None,
            cpu_s: None,
            own_bytes: None,
        };
        let snapshot = Snapshot {
            is_up: true,
            counts: board().counts(),
            processes: vec![source],
            traces: None,
        };
        let mut registry = Registry::with_prefix("gyre");
        registry.register_collector(Box::new(snapshot));
        let mut text = String::new();
        assert!(encode(&mut text, &registry).is_ok());
        for line in [
            "gyre_radar_missing_azimuths_total 3",
            "gyre_radar_scans_left_out_total 5",
            "gyre_radar_damaged_messages_total 0",
            "gyre_radar_foreign_messages_total 0",
            "gyre_radar_reconnections_total 7",
            "gyre_radar_receiving 1",
        ] {
            assert!(text.lines().any(|it| it == line), "{line}: {text}");
        }
    }

    #[test]
    fn who_accepts_the_newer_format_receives_it() {
        let (kind, text) = scrape(
            &board(),
            b"application/openmetrics-text;version=1.0.0,*/*;q=0.1",
        );
        assert_eq!(kind, OPEN_METRICS);
        assert!(text.ends_with("# EOF\n"));
        assert_eq!(families(&text).get("gyre_poses"), Some(&"counter"));
        assert!(text.contains("\ngyre_poses_total 0\n"), "{text}");
    }
}
