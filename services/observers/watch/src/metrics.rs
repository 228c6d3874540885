//! The metrics of the run, in the text format OpenMetrics.

use std::fmt;

use prometheus_client::{
    collector::Collector,
    encoding::{DescriptorEncoder, EncodeMetric, text::encode},
    metrics::{MetricType, counter::ConstCounter, gauge::ConstGauge, info::Info},
    registry::{Registry, Unit},
};

use gyre_messages::Basis;

use crate::{messages::RunCounts, processes::Process, run_view::RunView};

/// The type of the answer.
pub const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Counts and states at the time of a scrape.
#[derive(Debug)]
struct Snapshot {
    is_up: bool,
    counts: RunCounts,
    processes: Vec<Process>,
}

/// Returns the text of the answer.
pub fn scrape(view: &RunView) -> String {
    let mut registry = Registry::with_prefix("gyre");
    let run = view.run();
    let labels = vec![
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("out", run.out),
    ];
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
        self.encode_counts(&mut encoder)?;
        self.encode_witnesses(&mut encoder)?;
        self.encode_samples(&mut encoder)?;
        self.encode_missed(&mut encoder)?;
        self.encode_received(&mut encoder)?;
        self.encode_processes(&mut encoder)
    }
}

fn counter(encoder: &mut DescriptorEncoder<'_>, name: &str, help: &str, count: u64) -> fmt::Result {
    let counter = ConstCounter::new(count);
    counter.encode(encoder.encode_descriptor(name, help, None, MetricType::Counter)?)
}

fn gauge(
    encoder: &mut DescriptorEncoder<'_>,
    name: &str,
    help: &str,
    value: impl Into<u64>,
) -> fmt::Result {
    let gauge = ConstGauge::new(value.into());
    gauge.encode(encoder.encode_descriptor(name, help, None, MetricType::Gauge)?)
}

impl Snapshot {
    fn encode_counts(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let counts = &self.counts;
        let help = "Scans that the source has published.";
        counter(encoder, "scans_published", help, counts.published)?;
        counter(encoder, "poses", "Poses of the trajectory.", counts.poses)?;
        let help = "Scans that live mode has dropped.";
        counter(encoder, "scans_dropped", help, counts.dropped)?;
        gauge(encoder, "up", "1 while a run works, else 0.", self.is_up)?;
        let help = "Scans that were published and have no pose yet.";
        gauge(encoder, "scans_in_flight", help, counts.in_flight)
    }

    /// Encodes the basis of the motions, and the share of gyro, wheels and Doppler.
    fn encode_witnesses(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let counts = &self.counts.witnesses;
        let by_basis = Basis::ALL.iter().zip(counts.by_basis);
        let by_basis: Vec<_> = by_basis
            .map(|(basis, count)| (basis.name(), count))
            .collect();
        let gyro = [("used", counts.gyro_used), ("refused", counts.gyro_refused)];
        let wheels = [("used", counts.wheels_used), ("slip", counts.wheel_slips)];
        let doppler = [
            ("used", counts.doppler_used),
            ("refused", counts.doppler_refused),
        ];
        let families = [
            (
                "motions",
                "Motions by what they rest on.",
                "basis",
                by_basis,
            ),
            (
                "gyro_turns",
                "Turns that the gyro has measured: used, or refused since the radar contradicts.",
                "state",
                gyro.to_vec(),
            ),
            (
                "wheel_distances",
                "Distances that the wheels have measured: used, or slipping.",
                "state",
                wheels.to_vec(),
            ),
            (
                "doppler_velocities",
                "Velocities by Doppler: used, or refused since the matches contradict.",
                "state",
                doppler.to_vec(),
            ),
        ];
        for (name, help, label, values) in families {
            let mut family = encoder.encode_descriptor(name, help, None, MetricType::Counter)?;
            for (value, count) in values {
                ConstCounter::new(count).encode(family.encode_family(&[(label, value)])?)?;
            }
        }
        Ok(())
    }

    /// Encodes counts and rates of the samples of gyro and wheels, if there are any.
    fn encode_samples(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let samples = &self.counts.samples;
        let sensors = [
            ("gyro", samples.gyro, samples.gyro_hz),
            ("wheels", samples.wheels, samples.wheels_hz),
        ];
        if sensors.iter().all(|(.., rate_hz)| rate_hz.is_none()) {
            return Ok(());
        }
        let help = "Samples that were left out, since they came late or were unusable.";
        counter(encoder, "samples_left_out", help, samples.left_out)?;
        let help = "Samples that came with the scans.";
        let mut family = encoder.encode_descriptor("samples", help, None, MetricType::Counter)?;
        for (sensor, count, _) in sensors {
            ConstCounter::new(count).encode(family.encode_family(&[("sensor", sensor)])?)?;
        }
        let help = "Samples a second by their stamps, over the last scans.";
        let unit = Unit::Other("hertz".to_owned());
        let mut family =
            encoder.encode_descriptor("sample_rate", help, Some(&unit), MetricType::Gauge)?;
        for (sensor, _, rate_hz) in sensors {
            let rate_hz = rate_hz.unwrap_or(0.0);
            ConstGauge::new(rate_hz).encode(family.encode_family(&[("sensor", sensor)])?)?;
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
            ("objects", missed.objects),
        ];
        for (topic, count) in topics {
            ConstCounter::new(count).encode(family.encode_family(&[("topic", topic)])?)?;
        }
        Ok(())
    }

    /// Encodes the losses of a live radar, if the source receives one.
    fn encode_received(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let Some(received) = self.processes.iter().find_map(|it| it.received) else {
            return Ok(());
        };
        let help = "Turns of the radar of which there is no scan.";
        counter(
            encoder,
            "radar_scans_left_out",
            help,
            received.scans_left_out,
        )?;
        let help = "Azimuths that are missing from the scans.";
        let missing = received.missing_azimuths;
        counter(encoder, "radar_missing_azimuths", help, missing)?;
        let help = "Messages of the radar that could not be read.";
        let damaged = received.damaged_messages;
        counter(encoder, "radar_damaged_messages", help, damaged)?;
        let help = "Datagrams of others, and descriptions that do not fit into the run.";
        let foreign = received.foreign_messages;
        counter(encoder, "radar_foreign_messages", help, foreign)?;
        let help = "Connections to the radar after the first.";
        counter(
            encoder,
            "radar_reconnections",
            help,
            received.reconnections(),
        )?;
        let help = "1 while azimuths arrive from the radar, else 0.";
        gauge(encoder, "radar_receiving", help, received.is_receiving)
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
    use gyre_messages::{Hop, Item, PoseHeader, StageId, flag, gyro, outcome, wheels};
    use gyre_stage::source::Received;

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
    fn each_sample_is_of_a_family_with_a_type_and_a_help() {
        let text = scrape(&view());
        let types = text.lines().filter_map(|line| line.strip_prefix("# TYPE "));
        let families: Vec<_> = types.filter_map(|line| line.split_once(' ')).collect();
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let name = line.split(['{', ' ']).next().unwrap_or_default();
            let suffixes = ["_bucket", "_sum", "_count", "_total", "_info"];
            let mut stems = suffixes
                .iter()
                .filter_map(|suffix| name.strip_suffix(suffix));
            let family = stems.next().unwrap_or(name);
            assert!(families.iter().any(|(name, _)| *name == family), "{line}");
            assert!(text.contains(&format!("# HELP {family} ")), "{line}");
            let value = line.rsplit(' ').next().map(str::parse::<f64>);
            assert!(matches!(value, Some(Ok(_))), "{line}");
        }
        for (name, _) in families {
            assert!(
                name.starts_with("gyre_") && !name.starts_with("gyre_gyre"),
                "{name}"
            );
        }
        assert!(text.ends_with("# EOF\n"), "{text}");
        let delays = "gyre_hop_seconds_sum{stage=\"masking\",part=\"work\"} 0.003";
        assert!(text.contains(delays), "{text}");
    }

    #[test]
    fn alarms_are_of_metrics_that_exist_and_one_is_of_a_run_that_has_ended() {
        let rules = include_str!("../../../../configs/prometheus/gyre.rules.yml");
        assert!(rules.contains("expr: gyre_up == 0\n"));
        let text = scrape(&view());
        let words = rules.split(|c: char| !c.is_alphanumeric() && c != '_');
        for name in words.filter(|word| word.starts_with("gyre_")) {
            // A counter without a sample is named without its ending.
            let family = name.trim_end_matches("_total").trim_end_matches("_bucket");
            assert!(text.contains(&format!("# TYPE {family} ")), "{name}");
        }
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
            counts: view().counts(),
            processes: vec![source],
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
    fn motions_are_counted_by_what_they_rest_on() {
        let view = view();
        let mut pose = PoseHeader::default();
        let record = &mut pose.motion.refinement;
        (record.outcome, record.gyro, record.wheels) =
            (outcome::PREDICTED, gyro::REFUSED, wheels::USED);
        view.add_to_track(&pose);
        // The first pose of a chain has no motion.
        pose.item.flags = flag::BREAK;
        view.add_to_track(&pose);
        let text = scrape(&view);
        for line in [
            "gyre_motions_total{basis=\"dead reckoning\"} 1",
            "gyre_motions_total{basis=\"radar only\"} 0",
            "gyre_gyro_turns_total{state=\"refused\"} 1",
            "gyre_gyro_turns_total{state=\"used\"} 0",
            "gyre_wheel_distances_total{state=\"used\"} 1",
            "gyre_wheel_distances_total{state=\"slip\"} 0",
            "gyre_doppler_velocities_total{state=\"used\"} 0",
        ] {
            assert!(text.lines().any(|it| it == line), "{line}: {text}");
        }
    }

    #[test]
    fn samples_are_counted_with_their_rates_and_missing_without_any() {
        let mut snapshot = Snapshot {
            is_up: true,
            counts: view().counts(),
            processes: Vec::new(),
        };
        let text = |snapshot: Snapshot| {
            let mut registry = Registry::with_prefix("gyre");
            registry.register_collector(Box::new(snapshot));
            let mut text = String::new();
            assert!(encode(&mut text, &registry).is_ok());
            text
        };
        snapshot.counts.samples = gyre_messages::SampleHealth {
            gyro: 2080,
            left_out: 3,
            gyro_hz: Some(208.0),
            ..Default::default()
        };
        let text = text(snapshot);
        for line in [
            "gyre_samples_total{sensor=\"gyro\"} 2080",
            "gyre_samples_left_out_total 3",
            "gyre_sample_rate_hertz{sensor=\"gyro\"} 208.0",
            "gyre_sample_rate_hertz{sensor=\"wheels\"} 0.0",
        ] {
            assert!(text.lines().any(|it| it == line), "{line}: {text}");
        }
        let without = scrape(&view());
        assert!(!without.contains("gyre_sample"), "{without}");
    }
}
