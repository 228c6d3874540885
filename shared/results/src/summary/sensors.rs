//! The use of gyro, wheels, Doppler and GNSS in a run, and errors of their settings.

use std::collections::VecDeque;

use gyre_calibration::{Compared, compare};
use gyre_configuration::Configuration;
use gyre_contract::{
    Measures, PoseHeader, Witness, WitnessRecord, flag, initial_guess, outcome, verdict,
};
use gyre_geometry::samples::SensorConfig;
use serde::{Serialize, Serializer, ser::SerializeMap};

use super::{Counts, GnssSummary};

/// Largest shares of turns that are doubted or refused, and of distances of slipping wheels, in a
/// run that succeeds. Fewer contradictions are chance.
const MAX_DOUBTED_SHARE: f64 = 0.1;
const MAX_SLIPPING_SHARE: f64 = 0.5;
const MIN_CONTRADICTIONS: u64 = 10;
/// A delay or a scale that is off by more than so many standard deviations is wrong.
const SIGMAS: f64 = 4.0;
/// Delay and scale are measured over so many motions: an hour.
const MOTIONS_OF_DELAY: usize = 1 << 14;

/// The part of a kind of sensor in the motions of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorCount {
    /// Motions that it measured; the radar alone measured the others.
    pub motions: u64,
    /// Motions whose measurement differed from the radar's by more than noise, and was weighed all
    /// the same, since single matches can err by so much.
    pub doubted: u64,
    /// Motions that did not use it: it differed from the radar, or had differed recently.
    pub refused: u64,
    /// Motions that were predicted by it, since the radar saw nothing that matched.
    pub predicted: u64,
    /// Scale and bias after the last of these motions.
    pub last: WitnessRecord,
    /// The delay of its stamps, s, and its scale against the radar over the whole run, each with
    /// its standard deviation; `None`: they are unknown.
    pub delay_and_scale: Option<[[f64; 2]; 2]>,
}

/// Of each kind; `None`: it has measured nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorCounts(pub [Option<SensorCount>; Witness::ALL.len()]);

impl SensorCounts {
    pub fn of(&self, kind: Witness) -> Option<&SensorCount> {
        self.0[kind as usize].as_ref()
    }
}

impl Serialize for SensorCounts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let kinds = Witness::ALL.into_iter();
        let there = kinds.filter_map(|kind| Some((kind.name(), Named(kind, self.of(kind)?))));
        serializer.collect_map(there)
    }
}

struct Named<'a>(Witness, &'a SensorCount);

impl Serialize for Named<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(kind, count) = self;
        let (row, last) = (kind.row(), &count.last);
        let [_, refused] = row.refused;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("motions", &count.motions)?;
        match row.measures {
            Measures::Turn => {
                map.serialize_entry("doubted", &count.doubted)?;
                map.serialize_entry(refused, &count.refused)?;
                map.serialize_entry("bias_radps", &last.bias)?;
                map.serialize_entry("bias_sigma_radps", &last.bias_sigma)?;
                map.serialize_entry("scale", &last.scale)?;
            }
            Measures::Distance => {
                map.serialize_entry(refused, &count.refused)?;
                map.serialize_entry("predicted", &count.predicted)?;
                map.serialize_entry("scale", &last.scale)?;
                map.serialize_entry("scale_sigma", &last.scale_sigma)?;
            }
            Measures::Heading => {
                map.serialize_entry(refused, &count.refused)?;
                map.serialize_entry("offset_rad", &last.bias)?;
                map.serialize_entry("offset_sigma_rad", &last.bias_sigma)?;
            }
        }
        // A heading, whose offset is unknown, is not compared with motions.
        if row.samples.is_some() && row.measures != Measures::Heading {
            map.serialize_entry("delay_s", &count.delay_and_scale.map(|it| it[0]))?;
        }
        map.end()
    }
}

#[derive(Debug, Default)]
pub struct SensorCounter {
    counts: [SensorCount; Witness::ALL.len()],
    clocks: [Clock; Witness::ALL.len()],
}

impl SensorCounter {
    pub fn add(&mut self, pose: &PoseHeader) {
        let record = &pose.motion.refinement;
        for (kind, _) in Witness::sampled() {
            // A heading, whose offset is unknown, is no motion.
            if kind.row().measures != Measures::Heading {
                let of = record.of(kind);
                self.clocks[kind as usize].add(pose, of.registered, of.measured());
            }
        }
        let is_predicted = record.outcome == outcome::PREDICTED;
        for kind in Witness::ALL {
            let (of, count) = (record.of(kind), &mut self.counts[kind as usize]);
            if of.verdict == verdict::NONE {
                continue;
            }
            count.motions += 1;
            count.doubted += u64::from(of.verdict == verdict::DOUBTED);
            count.refused += u64::from(of.verdict == verdict::REFUSED);
            count.predicted += u64::from(is_predicted && record.distance_by() == Some(kind));
            count.last = *of;
        }
    }

    pub fn counts(self) -> SensorCounts {
        let mut clocks = self.clocks.into_iter();
        let all = Witness::ALL.map(|kind| {
            let has_bias = kind.row().measures == Measures::Turn;
            let delay_and_scale = clocks
                .next()
                .and_then(|clock| clock.delay_and_scale(has_bias));
            let count = SensorCount {
                delay_and_scale,
                ..self.counts[kind as usize]
            };
            (count.motions > 0).then_some(count)
        });
        SensorCounts(all)
    }
}

/// The motions by the radar alone and by a sensor, to measure the delay and the scale between them.
#[derive(Debug, Default)]
pub struct Clock(VecDeque<Compared>);

impl Clock {
    pub fn add(&mut self, pose: &PoseHeader, by_radar: f64, by_sensor: Option<f64>) {
        if self.0.is_empty() && by_sensor.is_none() {
            return;
        }
        if self.0.len() == MOTIONS_OF_DELAY {
            self.0.pop_front();
        }
        let of = &pose.motion.refinement;
        let is_seen = of.outcome == outcome::REFINED
            && of.initial_guess != initial_guess::ALONG_WALLS
            && !pose.item.is(flag::BREAK);
        self.0.push_back(Compared {
            stamp_ns: pose.item.stamp_ns,
            interval_ns: pose.motion.interval_ns,
            radar: is_seen.then_some(by_radar),
            other: by_sensor,
        });
    }

    /// Returns the delay, s, and the scale, each with its standard deviation; `None` where they are
    /// not determined.
    pub fn delay_and_scale(mut self, has_bias: bool) -> Option<[[f64; 2]; 2]> {
        let both = compare(self.0.make_contiguous(), has_bias)?;
        Some(both.map(|estimate| [estimate.value, estimate.sigma]))
    }
}

/// Returns why a run has not used its sensors, or why their settings must be wrong.
pub fn problem(
    configuration: &Configuration,
    counts: &Counts,
    gnss: Option<&GnssSummary>,
) -> Option<String> {
    let sensors = &configuration.odometry.sensors;
    // Without a refinement it is not known what gyro and wheels were used for.
    let motions = counts.processed.saturating_sub(1 + counts.breaks);
    let motions = counts.motions.map_or(0, |_| motions);
    let is_unused = |kind: &Witness| sensors.is_used(*kind) && counts.sensors.of(*kind).is_none();
    let sampled = || Witness::sampled().map(|(kind, _)| kind);
    if let Some(section) = sampled().find(is_unused).map(Witness::name)
        && motions > 0
    {
        return Some(format!(
            "{section}.kind is set, but none of the {motions} motions has a measurement of it: no samples arrived, or they are farther apart than {section}.max_gap_s. `gyre inspect` shows the log of a recording, and {section}.kind=none leaves it out"
        ));
    }
    let contradicted = |kind: Witness| {
        let it = counts.sensors.of(kind)?;
        let contradictions = it.doubted + it.refused;
        let is_wrong = match kind.row().measures {
            Measures::Turn => {
                too_many(contradictions, it.motions, MAX_DOUBTED_SHARE)
                    || (it.last.scale - 1.0).abs() > sensors.gyro.max_scale_error()
            }
            Measures::Distance => too_many(contradictions, it.motions, MAX_SLIPPING_SHARE),
            Measures::Heading => too_many(contradictions, it.motions, MAX_DOUBTED_SHARE),
        };
        let section = kind.name();
        let cause = cause(kind, sensors.of(kind)?, it, is_wrong)?;
        let motions = it.motions;
        Some(match kind.row().measures {
            Measures::Turn => format!(
                "the {section} contradicts the radar: {contradictions} of its {motions} turns were doubted or refused; {cause}, and {section}.kind=none leaves it out"
            ),
            Measures::Heading => format!(
                "the {section} contradicts the radar: {contradictions} of its {motions} headings were refused; {cause}, and {section}.kind=none leaves it out"
            ),
            Measures::Distance => format!(
                "the {section} contradict the radar: {contradictions} of their {motions} distances are not those that it sees; {cause}, and {section}.kind=none leaves them out"
            ),
        })
    };
    let by_gnss = || {
        let (reason, _) = gnss?.refusal().filter(|it| it.1)?;
        Some(format!("the fixes of GNSS are not used: {reason}"))
    };
    sampled().find_map(contradicted).or_else(by_gnss)
}

/// Returns which key of a sensor is wrong: the delay or the scale, if one of them is certain.
fn cause(
    kind: Witness,
    config: &dyn SensorConfig,
    it: &SensorCount,
    is_wrong: bool,
) -> Option<String> {
    let section = kind.name();
    let up = match kind.row().measures {
        Measures::Turn => "`gyro.up`, ",
        Measures::Distance | Measures::Heading => "",
    };
    let (set_scale, max_error) = config.scale();
    let is_late = |[delay_s, sigma_s]: &[f64; 2]| delay_s.abs() > SIGMAS * sigma_s;
    let is_scaled =
        |[scale, sigma]: &[f64; 2]| (scale - 1.0).abs() > max_error.hypot(SIGMAS * sigma);
    let [delay, scale] = it.delay_and_scale.map_or([None; 2], |it| it.map(Some));
    match (delay.filter(is_late), scale.filter(is_scaled)) {
        (Some([delay_s, sigma_s]), _) => Some(format!(
            "the stamps are late by {delay_s:.2} \u{b1} {sigma_s:.2} s: set {section}.delay_s={:.2}, which `gyre calibrate` finds too",
            config.delay_s() + delay_s
        )),
        (None, Some([scale, sigma])) => Some(format!(
            "the true values are {scale:.3} \u{b1} {sigma:.3} times the measured ones: set {section}.scale={:.3}, which `gyre calibrate` finds too",
            set_scale * scale
        )),
        _ if is_wrong && kind.row().measures == Measures::Heading => Some(format!(
            "it turns the other way, is of another drive, or `{section}.delay_s` or `{section}.noise_deg` is wrong"
        )),
        _ => is_wrong.then(|| {
            format!(
                "{up}`{section}.delay_s`, `{section}.scale` or the unit of the log is wrong: `gyre calibrate` finds them from a recording"
            )
        }),
    }
}

pub fn too_many(contradictions: u64, motions: u64, max_share: f64) -> bool {
    contradictions >= MIN_CONTRADICTIONS && contradictions as f64 > max_share * motions as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_its_keys_and_a_prediction_is_by_the_first_that_measures_the_distance() {
        let mut counter = SensorCounter::default();
        let of = [verdict::USED, verdict::DOUBTED, verdict::REFUSED];
        for (gyro, wheels, doppler) in [(0, 0, 0), (1, 2, 0), (2, 2, 2), (0, 0, 2)] {
            let mut pose = PoseHeader::default();
            let record = &mut pose.motion.refinement;
            record.outcome = outcome::PREDICTED;
            for (of_kind, index) in record.witnesses.iter_mut().zip([gyro, wheels, doppler]) {
                *of_kind = WitnessRecord {
                    verdict: of[index],
                    measured: 7.0,
                    scale: 1.5,
                    scale_sigma: 0.25,
                    bias: 0.5,
                    bias_sigma: 0.125,
                    ..WitnessRecord::default()
                };
            }
            counter.add(&pose);
        }
        let counts = Counts {
            sensors: counter.counts(),
            ..Counts::default()
        };
        let expected = concat!(
            r#"{"published":0,"processed":0,"dropped":0,"unreadable":0,"missing":0,"breaks":0,"#,
            r#""gyro":{"motions":4,"doubted":1,"refused":1,"bias_radps":0.5,"#,
            r#""bias_sigma_radps":0.125,"scale":1.5,"delay_s":null},"#,
            r#""wheels":{"motions":4,"slips":2,"predicted":2,"scale":1.5,"scale_sigma":0.25,"#,
            r#""delay_s":null},"#,
            r#""doppler":{"motions":4,"refused":2,"predicted":1,"scale":1.5,"scale_sigma":0.25}}"#,
        );
        assert_eq!(serde_json::to_string(&counts).unwrap_or_default(), expected);
        let none = SensorCounter::default().counts();
        assert_eq!(serde_json::to_string(&none).unwrap_or_default(), "{}");
    }
}
