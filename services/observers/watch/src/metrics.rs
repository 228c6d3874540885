//! The metrics of the run, in the text format OpenMetrics.

use std::{fmt, path::Path};

use gyre_client::free_bytes;
use prometheus_client::{
    collector::Collector,
    encoding::{DescriptorEncoder, EncodeMetric, MetricEncoder, text::encode},
    metrics::{MetricType, counter::ConstCounter, gauge::ConstGauge, info::Info},
    registry::{Registry, Unit},
};

use gyre_contract::{
    Basis, Witness,
    control::{Phase, Status},
    outcome,
};

use crate::{messages::RunCounts, processes::Process, run_view::RunView};

pub const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

#[derive(Debug)]
struct Snapshot {
    is_up: bool,
    status: Option<Status>,
    /// `None`: the folder of the run is unknown or missing.
    free_bytes: Option<u64>,
    counts: RunCounts,
    processes: Vec<Process>,
}

pub fn scrape(view: &RunView) -> String {
    let mut registry = Registry::with_prefix("gyre");
    let run = view.run();
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let out = run.out.clone();
    let labels = vec![("version", version), ("build", run.build), ("out", run.out)];
    registry.register("run", "The run that is watched", Info::new(labels));
    registry.register_with_unit(
        "sensor_to_pose",
        "Time from the complete sweep to its pose",
        Unit::Seconds,
        view.histograms.sensor_to_pose.clone(),
    );
    registry.register_with_unit(
        "hop",
        "Time of a scan at each stage: transport from the stage before, wait, work",
        Unit::Seconds,
        view.histograms.hops.clone(),
    );
    registry.register_collector(Box::new(Snapshot {
        is_up: run.state.is_up(),
        status: view.status(),
        free_bytes: free_bytes(Path::new(&out)),
        counts: view.counts(),
        processes: view.processes(),
    }));
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = encode(&mut text, &registry);
    text
}

impl Collector for Snapshot {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        for (name, help, unit, kind, values) in self.metrics() {
            let mut metric = encoder.encode_descriptor(name, help, unit.as_ref(), kind)?;
            match values {
                Values::One(value) => encode_value(kind, value, metric)?,
                Values::By(label, values) => {
                    for (of, value) in values {
                        encode_value(kind, value, metric.encode_family(&[(label, of)])?)?;
                    }
                }
            }
        }
        Ok(())
    }
}

fn encode_value(kind: MetricType, value: f64, metric: MetricEncoder<'_>) -> fmt::Result {
    match kind {
        MetricType::Counter => ConstCounter::new(value).encode(metric),
        _ => ConstGauge::new(value).encode(metric),
    }
}

type Metric<'a> = (Name, Name, Option<Unit>, MetricType, Values<'a>);
type Name = &'static str;

enum Values<'a> {
    One(f64),
    /// A label, and a value for each of its values.
    By(Name, Vec<(&'a str, f64)>),
}

fn one(count: u64) -> Values<'static> {
    Values::One(count as f64)
}

fn by<const N: usize>(label: Name, counts: [(Name, u64); N]) -> Values<'static> {
    Values::By(label, counts.map(|(of, count)| (of, count as f64)).to_vec())
}

const COUNTER: MetricType = MetricType::Counter;
const GAUGE: MetricType = MetricType::Gauge;

impl Snapshot {
    /// Returns the metrics. A run without samples or a live radar lacks their metrics.
    #[rustfmt::skip]
    fn metrics(&self) -> Vec<Metric<'_>> {
        let (counts, of, missed) = (&self.counts, &self.counts.witnesses, &self.counts.missed);
        let by_outcome = (0..).zip(self.counts.outcomes);
        let by_outcome = by_outcome.map(|(code, count)| (outcome::name(code), count as f64));
        let by_basis = Basis::ALL.iter().zip(of.by_basis);
        let by_basis = by_basis.map(|(basis, count)| (basis.name(), count as f64));
        let by_kind = Witness::ALL.map(|kind| {
            let ([name, help], [refused, _]) = (kind.row().metric, kind.row().refused);
            let states = [("used", of.used[kind as usize]), (refused, of.refused[kind as usize])];
            (name, help, None, COUNTER, by("state", states))
        });
        let status = self.status.as_ref();
        let waits = status.is_some_and(|it| it.phase == Phase::WaitingForRadar);
        let mut metrics = vec![
            ("scans_published", "Scans that the source has published.", None, COUNTER, one(counts.published)),
            ("poses", "Poses of the trajectory.", None, COUNTER, one(counts.poses)),
            ("scans_dropped", "Scans that live mode has dropped.", None, COUNTER, one(counts.dropped)),
            ("up", "1 while a run works or waits for its radar, else 0.", None, GAUGE, one((self.is_up || waits).into())),
            ("waiting_for_radar", "1 while no azimuth arrives from the radar, else 0.", None, GAUGE, one(waits.into())),
            ("disk_full", "1 while poses wait in memory for room on the disk, or are lost, else 0.", None, GAUGE, one(status.is_some_and(|it| it.disk_is_full).into())),
            ("disk_free", "Room for the run on the disk of its folder.", Some(Unit::Bytes), GAUGE, self.free_bytes.map_or_else(|| by("", []), one)),
            ("pose_age", "Time since the newest pose; 0 before the first one, and when the stream has ended.", Some(Unit::Seconds), GAUGE, Values::One(counts.pose_age_s)),
            ("scans_in_flight", "Scans that were published and have no pose yet.", None, GAUGE, one(counts.in_flight)),
            ("motions", "Motions by what they rest on.", None, COUNTER, Values::By("basis", by_basis.collect())),
            ("matches", "Motions by the outcome of their match with the map.", None, COUNTER, Values::By("outcome", by_outcome.collect())),
        ];
        metrics.extend(by_kind);
        metrics.extend([
            ("observer_missed", "Messages that this observer has missed. Delays lack those of missed poses.", None, COUNTER, by("topic", [("pose", missed.pose), ("scan", missed.scan), ("masked", missed.masked), ("objects", missed.objects)])),
            ("process_restarts", "Restarts of a process of the run.", None, COUNTER, self.by_process(|it| Some(it.restarts as f64))),
            ("process_cpu", "Processor time of a process since its start.", Some(Unit::Seconds), COUNTER, self.by_process(|it| it.cpu_s)),
            ("process_memory", "Memory of a process's own.", Some(Unit::Bytes), GAUGE, self.by_process(|it| it.own_bytes.map(|bytes| bytes as f64))),
        ]);
        let samples = &counts.samples;
        if samples.rates_hz.iter().any(Option::is_some) {
            let by_sensor = |of: &dyn Fn(usize) -> f64| {
                let values = Witness::sampled().map(|(kind, _)| (kind.name(), of(kind as usize)));
                Values::By("sensor", values.collect())
            };
            let counts = by_sensor(&|kind| samples.counts[kind] as f64);
            let rates = by_sensor(&|kind| samples.rates_hz[kind].unwrap_or(0.0));
            metrics.extend([
                ("samples", "Samples that came with the scans.", None, COUNTER, counts),
                ("samples_left_out", "Samples that were left out, since they came late or were unusable.", None, COUNTER, one(samples.left_out)),
                ("sample_rate", "Samples a second by their stamps, over the last scans.", Some(Unit::Other("hertz".to_owned())), GAUGE, rates),
            ]);
        }
        let received = self.processes.iter().find_map(|it| it.received);
        if let Some(it) = received {
            metrics.extend([
                ("radar_scans_left_out", "Turns of the radar without a scan.", None, COUNTER, one(it.scans_left_out)),
                ("radar_missing_azimuths", "Azimuths that are missing from the scans.", None, COUNTER, one(it.missing_azimuths)),
                ("radar_damaged_messages", "Messages of the radar that could not be read.", None, COUNTER, one(it.damaged_messages)),
                ("radar_foreign_messages", "Datagrams of others, and descriptions that do not fit into the run.", None, COUNTER, one(it.foreign_messages)),
                ("radar_reconnections", "Connections to the radar after the first.", None, COUNTER, one(it.reconnections())),
                ("radar_receiving", "1 while azimuths arrive from the radar, else 0.", None, GAUGE, one(it.is_receiving.into())),
            ]);
        }
        if let Some(clock) = received.and_then(|it| it.clock) {
            metrics.extend([
                ("radar_clock_steps", "How often the clock of the radar or of this host was set.", None, COUNTER, one(clock.steps)),
                ("radar_clock_offset", "This host's time minus the radar's at the arrival of a scan, with the least delay of the network.", Some(Unit::Seconds), GAUGE, Values::One(clock.offset_ns as f64 * 1e-9)),
                ("radar_clock_jitter", "Delay of a scan beyond this offset: nine of ten have at most this.", Some(Unit::Seconds), GAUGE, Values::One(clock.jitter_ns as f64 * 1e-9)),
            ]);
        }
        metrics
    }

    fn by_process(&self, value: fn(&Process) -> Option<f64>) -> Values<'_> {
        let processes = self.processes.iter();
        let values = processes.filter_map(|it| Some((it.name.as_str(), value(it)?)));
        Values::By("process", values.collect())
    }
}

#[cfg(test)]
mod tests {
    use gyre_contract::{
        Hop, Item, PoseHeader, StageId,
        control::{Received, SensorClock},
        flag, outcome, verdict,
    };

    use super::*;

    fn view() -> RunView {
        let view = RunView::new("/a folder/\"quoted\"");
        let mut item = Item::default();
        for stage in [StageId::Masking, StageId::PoseIntegration] {
            *item.hop_mut(stage) = Hop {
                received_ns: 1_000_000,
                started_ns: 2_000_000,
                finished_ns: 5_000_000,
                published_ns: 6_000_000,
            };
        }
        view.histograms.add(&item);
        view
    }

    #[test]
    fn alarms_are_of_metrics_that_exist_and_one_is_of_a_run_that_has_ended() {
        let rules = include_str!("../../../../configs/prometheus/gyre.rules.yml");
        assert!(rules.contains("expr: gyre_up == 0\n"));
        let view = view();
        let received = Received {
            clock: Some(SensorClock::default()),
            ..Received::default()
        };
        let text = scrape(&view) + &of_sensors(view.counts(), received);
        let words = rules.split(|c: char| !c.is_alphanumeric() && c != '_');
        for name in words.filter(|word| word.starts_with("gyre_")) {
            // A counter without a sample is named without its ending.
            let family = ["_total", "_bucket", "_info"]
                .iter()
                .fold(name, |it, end| it.trim_end_matches(end));
            assert!(text.contains(&format!("# TYPE {family} ")), "{name}");
        }
        let delays = "gyre_hop_seconds_sum{stage=\"masking\",part=\"work\"} 0.003";
        assert!(text.contains(delays) && text.ends_with("# EOF\n"), "{text}");
    }

    #[test]
    fn a_run_that_waits_for_its_radar_is_up_and_a_full_disk_is_shown() {
        let view = view();
        let status = Status {
            phase: Phase::WaitingForRadar,
            disk_is_full: true,
            ..Status::default()
        };
        view.set_processes(&status, Vec::new());
        let text = scrape(&view);
        for name in ["gyre_up", "gyre_waiting_for_radar", "gyre_disk_full"] {
            assert!(text.contains(&format!("\n{name} 1.0\n")), "{name}: {text}");
        }
        view.set_unknown();
        assert!(scrape(&view).contains("\ngyre_up 0.0\n"));
    }

    /// The text of a run with a live radar and a gyro.
    fn of_sensors(mut counts: RunCounts, received: Received) -> String {
        counts.samples.rates_hz[Witness::Gyro as usize] = Some(208.0);
        let source = Process {
            name: "radar-replay".to_owned(),
            received: Some(received),
            cpu_s: Some(1.5),
            own_bytes: Some(4096),
            ..Process::default()
        };
        let mut registry = Registry::with_prefix("gyre");
        registry.register_collector(Box::new(Snapshot {
            is_up: true,
            status: None,
            free_bytes: None,
            counts,
            processes: vec![source],
        }));
        let mut text = String::new();
        assert!(encode(&mut text, &registry).is_ok());
        text
    }

    #[test]
    fn each_family_stands_once_with_its_help() {
        let view = view();
        for text in [
            scrape(&view),
            of_sensors(view.counts(), Received::default()),
        ] {
            let mut families = Vec::new();
            for rest in text.lines().filter_map(|line| line.strip_prefix("# HELP ")) {
                let (name, sentence) = rest.split_once(' ').unwrap_or_default();
                assert!(sentence.len() > 5 && !families.contains(&name), "{rest}");
                families.push(name);
            }
            assert!(families.len() > 12, "{families:?}");
            assert!(text.ends_with("\n# EOF\n"), "{text}");
        }
    }

    #[test]
    fn what_motions_rest_on_and_what_sensors_have_delivered_is_counted() {
        let view = view();
        let mut pose = PoseHeader::default();
        let record = &mut pose.motion.refinement;
        record.outcome = outcome::PREDICTED;
        record.of_mut(Witness::Gyro).verdict = verdict::REFUSED;
        record.of_mut(Witness::Wheels).verdict = verdict::USED;
        view.add_to_track(&pose);
        // The first pose of a chain has no motion.
        pose.item.flags = flag::BREAK;
        view.add_to_track(&pose);
        let without = scrape(&view);
        assert!(!without.contains("gyre_sample") && !without.contains("gyre_radar"));
        let received = Received {
            missing_azimuths: 3,
            scans_left_out: 5,
            connections: 8,
            is_receiving: true,
            clock: Some(SensorClock {
                offset_ns: -250_000_000,
                jitter_ns: 500_000_000,
                steps: 6,
            }),
            ..Received::default()
        };
        let mut counts = view.counts();
        counts.samples.counts[Witness::Gyro as usize] = 2080;
        counts.samples.left_out = 3;
        let text = of_sensors(counts, received);
        for line in [
            "gyre_motions_total{basis=\"dead reckoning\"} 1.0",
            "gyre_motions_total{basis=\"radar only\"} 0.0",
            "gyre_gyro_turns_total{state=\"refused\"} 1.0",
            "gyre_gyro_turns_total{state=\"used\"} 0.0",
            "gyre_wheel_distances_total{state=\"used\"} 1.0",
            "gyre_wheel_distances_total{state=\"slip\"} 0.0",
            "gyre_doppler_velocities_total{state=\"used\"} 0.0",
            "gyre_radar_missing_azimuths_total 3.0",
            "gyre_radar_scans_left_out_total 5.0",
            "gyre_radar_damaged_messages_total 0.0",
            "gyre_radar_foreign_messages_total 0.0",
            "gyre_radar_reconnections_total 7.0",
            "gyre_radar_receiving 1.0",
            "gyre_radar_clock_steps_total 6.0",
            "gyre_radar_clock_offset_seconds -0.25",
            "gyre_radar_clock_jitter_seconds 0.5",
            "gyre_samples_total{sensor=\"gyro\"} 2080.0",
            "gyre_samples_left_out_total 3.0",
            "gyre_sample_rate_hertz{sensor=\"gyro\"} 208.0",
            "gyre_sample_rate_hertz{sensor=\"wheels\"} 0.0",
        ] {
            assert!(text.lines().any(|it| it == line), "{line}: {text}");
        }
    }
}
