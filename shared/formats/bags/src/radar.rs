//! The description of a radar: its own in the bag, or what its azimuths show of it.

use std::path::Path;

use gyre_colossus::Configuration;
use gyre_radar::DatasetOptions;
use gyre_ros2_messages::{
    messages::RadarFftDataMessage,
    navtech_msgs::{RadarBScanMsg, RadarFftDataMsg},
    sensor_msgs::Image,
};

use crate::{
    BagError,
    azimuths::{Described, of},
    reading::Message,
    topics::{Form, Kind},
};

/// Encoder counts of Navtech's radars.
const ENCODER_COUNTS: u16 = 5600;
/// Azimuths from which the number of a turn is told: several turns.
pub(crate) const MAX_SAMPLES: usize = 2000;
/// The rotation of Navtech's radars, turns per 1000 s, where the times do not show it.
const ROTATION_MHZ: u16 = 4000;

/// The properties of the radar that a message shows.
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
}

impl Survey {
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            samples: Vec::new(),
        }
    }

    /// Returns whether more messages would show nothing new.
    pub fn is_done(&self) -> bool {
        let enough = match self.kind {
            Kind::Azimuths(_) => MAX_SAMPLES,
            _ => 2,
        };
        self.samples.len() >= enough
    }

    /// Looks at a message; those that are damaged show nothing.
    pub fn add(&mut self, message: &Message) {
        let of_image = |image: &Image| (0, image.height as usize, image.width as usize);
        let shown = match self.kind {
            Kind::Azimuths(Form::Numbers) => of::<RadarFftDataMsg>(message)
                .ok()
                .map(|m| (m.azimuth, 1, m.data.len())),
            Kind::Azimuths(Form::Bytes) => of::<RadarFftDataMessage>(message).ok().and_then(|m| {
                let encoder = m.azimuth().ok()?.encoder;
                Some((encoder, 1, m.data.len()))
            }),
            Kind::BScans => of::<RadarBScanMsg>(message)
                .ok()
                .map(|m| of_image(&m.b_scan_img)),
            Kind::Images => of::<Image>(message).ok().map(|image| of_image(&image)),
            Kind::Configuration(_) => None,
        };
        self.samples
            .extend(shown.map(|(encoder, azimuths, bins)| Sample {
                encoder,
                azimuths,
                bins,
                log_ns: message.log_ns,
            }));
    }

    /// Describes the radar with what the options say of it.
    ///
    /// # Errors
    /// An option that is needed is missing, or nothing is shown.
    pub fn describe(&self, path: &Path, options: &DatasetOptions) -> Result<Described, BagError> {
        let refuse = |reason: &str| Err(BagError::unreadable(path, reason));
        let Some(range_resolution_m) = options.range_resolution_m else {
            return refuse(
                "has no configuration of its radar (RadarConfigurationMsg): give the depth of a range bin with dataset.range_resolution_m \
                 (Navtech: 0.0438, 0.0596 or 0.04381), and dataset.encoder_counts if it is not 5600",
            );
        };
        let encoder_size = options.encoder_counts.unwrap_or(ENCODER_COUNTS);
        let Some(azimuths) = self.azimuths(encoder_size) else {
            return refuse("has no messages of its radar that can be read");
        };
        let bins = self.samples.iter().map(|sample| sample.bins).max();
        let small = |number: usize| u16::try_from(number).unwrap_or(u16::MAX);
        Ok(Described {
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

    /// Returns the rotation from the times at which messages were received.
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
            (100.0..=50_000.0)
                .contains(&mhz)
                .then(|| mhz.round() as u16)
        };
        measured().unwrap_or(ROTATION_MHZ)
    }
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
