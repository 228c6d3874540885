//! The description of a radar, by its configuration in the bag or by its azimuths.

use std::path::Path;

use gyre_colossus::Configuration;
use gyre_datasets::{EncoderTurn, FIRST_TURNS, encoder_counts, turn_ns};
use gyre_ros2_messages::{
    messages::RadarFftDataMessage,
    navtech_msgs::{RadarBScanMsg, RadarFftDataMsg},
    radar::DescribedRadar,
    sensor_msgs::Image,
};

use crate::bags::{
    Message, RecordingError,
    topics::{Form, Kind, of},
};

pub(crate) const ENCODER_COUNTS: u16 = 5600;
/// Azimuths, several turns, that determine the number per turn and the size of the encoder.
pub(crate) const MAX_SAMPLES: usize = 2000;
/// The rotation of Navtech's radars, turns per 1000 s, where the times do not show it.
const ROTATION_MHZ: u16 = 4000;

#[derive(Clone, Copy, Debug)]
struct Sample {
    encoder: u16,
    azimuths: usize,
    bins: usize,
    log_ns: i64,
}

/// The properties of a radar that the first messages of a topic show.
#[derive(Clone, Debug)]
pub(crate) struct Survey {
    kind: Kind,
    samples: Vec<Sample>,
    turns: Vec<Vec<RowShown>>,
}

/// The encoder value and the time of an azimuth, in any unit.
type RowShown = (u16, i64);

impl Survey {
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            samples: Vec::new(),
            turns: Vec::new(),
        }
    }

    /// Returns whether more messages would show nothing new.
    pub fn is_done(&self) -> bool {
        let enough = match self.kind {
            Kind::Azimuths(_) => MAX_SAMPLES,
            _ => FIRST_TURNS,
        };
        self.samples.len() >= enough
    }

    /// Looks at a message; those that are damaged show nothing.
    pub fn add(&mut self, message: &Message) {
        let log_ns = message.log_ns;
        let sample = |encoder, azimuths, bins| Sample {
            encoder,
            azimuths,
            bins,
            log_ns,
        };
        let of_image = |image: &Image| sample(0, image.height as usize, image.width as usize);
        let shown = match self.kind {
            Kind::Azimuths(Form::Numbers) => of::<RadarFftDataMsg>(message)
                .ok()
                .map(|m| sample(m.azimuth, 1, m.data.len())),
            Kind::Azimuths(Form::Bytes) => of::<RadarFftDataMessage>(message)
                .ok()
                .and_then(|m| Some(sample(m.azimuth().ok()?.encoder, 1, m.data.len()))),
            Kind::BScans => of::<RadarBScanMsg>(message).ok().map(|m| {
                let shown = |(_, value, time): (usize, u16, u64)| {
                    (value, i64::try_from(time).unwrap_or_default())
                };
                self.turns.push(m.written().map(shown).collect());
                of_image(&m.b_scan_img)
            }),
            Kind::Images => of::<Image>(message).ok().map(|image| of_image(&image)),
            Kind::Configuration(_) => None,
        };
        self.samples.extend(shown);
    }

    /// Describes a radar of this depth of a range bin, m, and these encoder counts per turn.
    pub fn describe(
        &self,
        path: &Path,
        range_resolution_m: Option<f32>,
        encoder_size: u16,
    ) -> Result<DescribedRadar, RecordingError> {
        let azimuths = self.azimuths(encoder_size);
        let (range_resolution_m, azimuths) = match (range_resolution_m, azimuths) {
            (Some(range_resolution_m), Some(azimuths)) => (range_resolution_m, azimuths),
            (None, _) => {
                let reason = "has no configuration of its radar (RadarConfigurationMsg): give the depth of a range bin with \
                              dataset.range_resolution_m (Navtech: 0.0438, 0.0596 or 0.04381)";
                return Err(RecordingError::unreadable(path, reason));
            }
            (_, None) => {
                let reason = "has no messages of its radar that can be read";
                return Err(RecordingError::unreadable(path, reason));
            }
        };
        let bins = self.samples.iter().map(|sample| sample.bins).max();
        let small = |number: usize| u16::try_from(number).unwrap_or(u16::MAX);
        Ok(DescribedRadar {
            radar: Configuration {
                azimuth_samples: small(azimuths),
                range_in_bins: small(bins.unwrap_or_default()),
                encoder_size,
                rotation_mhz: self.rotation_mhz(azimuths),
                range_resolution_m: Some(range_resolution_m),
                ..Configuration::default()
            },
            azimuth_offset: 0,
        })
    }

    /// Returns the encoder counts of a turn that the azimuths show, if `usual` is not them. Without
    /// times, a turn may lack a blanked sector: then `usual` is used if the radar itself sent it
    /// (`is_said`).
    pub fn other_counts(&self, usual: u16, is_said: bool) -> Option<u16> {
        let rows = self.samples.iter().map(|it| (it.encoder, it.log_ns));
        let rows: Vec<RowShown> = rows.collect();
        let is_by_azimuth = matches!(self.kind, Kind::Azimuths(_));
        let turns: Vec<&[RowShown]> = match is_by_azimuth {
            true => rows.chunk_by(|(a, _), (b, _)| a < b).collect(),
            false => self.turns.iter().map(Vec::as_slice).collect(),
        };
        // Of azimuths the first and the last turn are parts of one.
        let whole = match is_by_azimuth {
            true => turns.get(1..turns.len().max(2) - 1).unwrap_or_default(),
            false => &turns[..],
        };
        let (unit_ns, turn_ns) = turn_time(&turns).unzip();
        if is_said && turn_ns.is_none() {
            return None;
        }
        let unit_ns = unit_ns.unwrap_or(1);
        let turn = |rows: &&[RowShown]| {
            let counts: Vec<u16> = rows.iter().map(|(count, _)| *count).collect();
            EncoderTurn::new(&counts, |row| rows.get(row)?.1.checked_mul(unit_ns))
        };
        let turns: Vec<EncoderTurn> = whole.iter().map(turn).collect();
        // The last step of a turn may differ.
        let is_other = |counts: &u16| counts.abs_diff(usual) > usual / 50;
        encoder_counts(&turns, turn_ns, usual).filter(is_other)
    }

    /// Returns the azimuths of a turn: rows of an image, or the encoder's counts divided by the
    /// usual step.
    fn azimuths(&self, encoder_size: u16) -> Option<usize> {
        let first = self.samples.first()?;
        if !matches!(self.kind, Kind::Azimuths(_)) {
            return Some(first.azimuths);
        }
        let pairs = self.samples.windows(2);
        let steps = pairs.map(|pair| pair[1].encoder.saturating_sub(pair[0].encoder));
        let mut steps: Vec<u16> = steps.filter(|step| *step > 0).collect();
        steps.sort_unstable();
        let step = usize::from(*steps.get(steps.len() / 2)?);
        Some((usize::from(encoder_size) + step / 2) / step)
    }

    fn rotation_mhz(&self, azimuths: usize) -> u16 {
        let measured = || {
            let (first, last) = (self.samples.first()?, self.samples.last()?);
            let messages = self.samples.len() - 1;
            let turns = match self.kind {
                Kind::Azimuths(_) => messages as f64 / azimuths.max(1) as f64,
                _ => messages as f64,
            };
            let seconds = last.log_ns.saturating_sub(first.log_ns) as f64 * 1e-9;
            let mhz = 1000.0 * turns / seconds;
            // From one turn in ten seconds to fifty in one.
            let is_plausible = (100.0..=50_000.0).contains(&mhz);
            is_plausible.then(|| mhz.round() as u16)
        };
        measured().unwrap_or(ROTATION_MHZ)
    }
}

/// Returns the unit of row times that gives a plausible duration of a turn, and this duration, ns.
fn turn_time(turns: &[&[RowShown]]) -> Option<(i64, i64)> {
    let starts = turns.iter().filter_map(|rows| Some(rows.first()?.1));
    [1, 1_000, 1_000_000].into_iter().find_map(|unit_ns| {
        let starts_ns = starts.clone().map(|start| start.saturating_mul(unit_ns));
        Some((unit_ns, turn_ns(starts_ns)?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuths_are_counted_with_the_finest_encoder() {
        let mut survey = Survey::new(Kind::Azimuths(Form::Numbers));
        survey.samples = (0..400_u16)
            .map(|azimuth| Sample {
                encoder: azimuth * 163,
                azimuths: 1,
                bins: 8,
                log_ns: 0,
            })
            .collect();
        assert_eq!(survey.azimuths(u16::MAX), Some(402));
    }
}
