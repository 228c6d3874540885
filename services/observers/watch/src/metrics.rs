//! The metrics of the run, in the text format OpenMetrics.

use std::fmt;

use prometheus_client::{
    collector::Collector,
    encoding::{
        DescriptorEncoder, EncodeCounterValue, EncodeGaugeValue, EncodeMetric, MetricEncoder,
        text::encode,
    },
    metrics::{MetricType, counter::ConstCounter, gauge::ConstGauge, info::Info},
    registry::{Registry, Unit},
};

use gyre_messages::Basis;

use crate::{messages::RunCounts, processes::Process, run_view::RunView};

/// The type of the answer.
pub const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

#[derive(Debug)]
struct Snapshot {
    is_up: bool,
    counts: RunCounts,
    processes: Vec<Process>,
}

pub fn scrape(view: &RunView) -> String {
    let mut registry = Registry::with_prefix("gyre");
    let run = view.run();
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let labels = vec![("version", version), ("out", run.out)];
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
        let encoder = &mut encoder;
        for (name, help, kind, value) in self.numbers() {
            let metric = encoder.encode_descriptor(name, help, None, kind)?;
            encode_value(kind, value, metric)?;
        }
        for (name, help, label, values) in self.labelled() {
            let description = (name, help, None, MetricType::Counter);
            family(encoder, description, label, values)?;
        }
        self.encode_rates(encoder)?;
        self.encode_processes(encoder)
    }
}

type Description<'a> = (&'a str, &'a str, Option<Unit>, MetricType);

fn family<'a, N: EncodeCounterValue + EncodeGaugeValue>(
    encoder: &mut DescriptorEncoder<'_>,
    (name, help, unit, kind): Description<'_>,
    label: &str,
    values: impl IntoIterator<Item = (&'a str, N)>,
) -> fmt::Result {
    let mut family = encoder.encode_descriptor(name, help, unit.as_ref(), kind)?;
    for (of, value) in values {
        encode_value(kind, value, family.encode_family(&[(label, of)])?)?;
    }
    Ok(())
}

fn encode_value<N: EncodeCounterValue + EncodeGaugeValue>(
    kind: MetricType,
    value: N,
    metric: MetricEncoder<'_>,
) -> fmt::Result {
    match kind {
        MetricType::Counter => ConstCounter::new(value).encode(metric),
        _ => ConstGauge::new(value).encode(metric),
    }
}

/// A name, a help, a label, and a count for each value of the label.
type Labelled = (Name, Name, Name, Vec<(Name, u64)>);
type Name = &'static str;

impl Snapshot {
    /// Returns the metrics without labels: a name, a help, a type and a value of each. Those of
    /// samples and of a live radar are missing in a run without them.
    #[rustfmt::skip]
    fn numbers(&self) -> Vec<(&'static str, &'static str, MetricType, u64)> {
        const COUNTER: MetricType = MetricType::Counter;
        const GAUGE: MetricType = MetricType::Gauge;
        let counts = &self.counts;
        let mut numbers = vec![
            ("scans_published", "Scans that the source has published.", COUNTER, counts.published),
            ("poses", "Poses of the trajectory.", COUNTER, counts.poses),
            ("scans_dropped", "Scans that live mode has dropped.", COUNTER, counts.dropped),
            ("up", "1 while a run works, else 0.", GAUGE, u64::from(self.is_up)),
            ("scans_in_flight", "Scans that were published and have no pose yet.", GAUGE, counts.in_flight),
        ];
        if self.has_samples() {
            let help = "Samples that were left out, since they came late or were unusable.";
            numbers.push(("samples_left_out", help, COUNTER, counts.samples.left_out));
        }
        if let Some(it) = self.processes.iter().find_map(|it| it.received) {
            numbers.extend([
                ("radar_scans_left_out", "Turns of the radar of which there is no scan.", COUNTER, it.scans_left_out),
                ("radar_missing_azimuths", "Azimuths that are missing from the scans.", COUNTER, it.missing_azimuths),
                ("radar_damaged_messages", "Messages of the radar that could not be read.", COUNTER, it.damaged_messages),
                ("radar_foreign_messages", "Datagrams of others, and descriptions that do not fit into the run.", COUNTER, it.foreign_messages),
                ("radar_reconnections", "Connections to the radar after the first.", COUNTER, it.reconnections()),
                ("radar_receiving", "1 while azimuths arrive from the radar, else 0.", GAUGE, u64::from(it.is_receiving)),
            ]);
        }
        numbers
    }

    #[rustfmt::skip]
    fn labelled(&self) -> Vec<Labelled> {
        let (of, missed, samples) = (&self.counts.witnesses, &self.counts.missed, &self.counts.samples);
        let by_basis = Basis::ALL.iter().zip(of.by_basis).map(|(basis, count)| (basis.name(), count));
        let used = |used, other, count| vec![("used", used), (other, count)];
        let missed = [("pose", missed.pose), ("scan", missed.scan), ("masked", missed.masked), ("objects", missed.objects)];
        let mut labelled: Vec<Labelled> = vec![
            ("motions", "Motions by what they rest on.", "basis", by_basis.collect()),
            ("gyro_turns", "Turns that the gyro has measured: used, or refused since the radar contradicts.", "state", used(of.gyro_used, "refused", of.gyro_refused)),
            ("wheel_distances", "Distances that the wheels have measured: used, or slipping.", "state", used(of.wheels_used, "slip", of.wheel_slips)),
            ("doppler_velocities", "Velocities by Doppler: used, or refused since the matches contradict.", "state", used(of.doppler_used, "refused", of.doppler_refused)),
            ("observer_missed", "Messages that this observer has missed. Delays lack those of missed poses.", "topic", missed.to_vec()),
        ];
        if self.has_samples() {
            let counts = vec![("gyro", samples.gyro), ("wheels", samples.wheels)];
            labelled.push(("samples", "Samples that came with the scans.", "sensor", counts));
        }
        labelled
    }

    fn has_samples(&self) -> bool {
        let samples = &self.counts.samples;
        samples.gyro_hz.is_some() || samples.wheels_hz.is_some()
    }

    fn encode_rates(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        if !self.has_samples() {
            return Ok(());
        }
        let samples = &self.counts.samples;
        let rates = [("gyro", samples.gyro_hz), ("wheels", samples.wheels_hz)];
        let rates = rates.map(|(sensor, rate_hz)| (sensor, rate_hz.unwrap_or(0.0)));
        let help = "Samples a second by their stamps, over the last scans.";
        let unit = Some(Unit::Other("hertz".to_owned()));
        let description = ("sample_rate", help, unit, MetricType::Gauge);
        family(encoder, description, "sensor", rates)
    }

    fn encode_processes(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let help = "Restarts of a process of the run.";
        let restarts = self.of_processes(|it| Some(it.restarts as f64));
        let description = ("process_restarts", help, None, MetricType::Counter);
        family(encoder, description, "process", restarts)?;
        let help = "Processor time of a process since its start.";
        let cpu = self.of_processes(|it| it.cpu_s);
        let unit = Some(Unit::Seconds);
        let description = ("process_cpu", help, unit, MetricType::Counter);
        family(encoder, description, "process", cpu)?;
        let help = "Memory of a process's own.";
        let memory = self.of_processes(|it| it.own_bytes.map(|bytes| bytes as f64));
        let description = ("process_memory", help, Some(Unit::Bytes), MetricType::Gauge);
        family(encoder, description, "process", memory)
    }

    fn of_processes(
        &self,
        value: fn(&Process) -> Option<f64>,
    ) -> impl Iterator<Item = (&str, f64)> {
        let processes = self.processes.iter();
        processes.filter_map(move |it| Some((it.name.as_str(), value(it)?)))
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
        let delays = "gyre_hop_seconds_sum{stage=\"masking\",part=\"work\"} 0.003";
        assert!(text.contains(delays) && text.ends_with("# EOF\n"), "{text}");
    }

    #[test]
    fn what_motions_rest_on_and_what_sensors_have_delivered_is_counted() {
        let view = view();
        let mut pose = PoseHeader::default();
        let record = &mut pose.motion.refinement;
        (record.outcome, record.gyro, record.wheels) =
            (outcome::PREDICTED, gyro::REFUSED, wheels::USED);
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
            ..Received::default()
        };
        let source = Process {
            received: Some(received),
            ..Process::default()
        };
        let mut counts = view.counts();
        counts.samples = gyre_messages::SampleHealth {
            gyro: 2080,
            left_out: 3,
            gyro_hz: Some(208.0),
            ..Default::default()
        };
        let snapshot = Snapshot {
            is_up: true,
            counts,
            processes: vec![source],
        };
        let mut registry = Registry::with_prefix("gyre");
        registry.register_collector(Box::new(snapshot));
        let mut text = String::new();
        assert!(encode(&mut text, &registry).is_ok());
        for line in [
            "gyre_motions_total{basis=\"dead reckoning\"} 1",
            "gyre_motions_total{basis=\"radar only\"} 0",
            "gyre_gyro_turns_total{state=\"refused\"} 1",
            "gyre_gyro_turns_total{state=\"used\"} 0",
            "gyre_wheel_distances_total{state=\"used\"} 1",
            "gyre_wheel_distances_total{state=\"slip\"} 0",
            "gyre_doppler_velocities_total{state=\"used\"} 0",
            "gyre_radar_missing_azimuths_total 3",
            "gyre_radar_scans_left_out_total 5",
            "gyre_radar_damaged_messages_total 0",
            "gyre_radar_foreign_messages_total 0",
            "gyre_radar_reconnections_total 7",
            "gyre_radar_receiving 1",
            "gyre_samples_total{sensor=\"gyro\"} 2080",
            "gyre_samples_left_out_total 3",
            "gyre_sample_rate_hertz{sensor=\"gyro\"} 208.0",
            "gyre_sample_rate_hertz{sensor=\"wheels\"} 0.0",
        ] {
            assert!(text.lines().any(|it| it == line), "{line}: {text}");
        }
    }
}
