//! The estimate of a radar's configuration from azimuths, where its driver does not publish it.

use gyre_colossus::Configuration;

use super::driver::PacketMessage;

/// The most azimuths that are used: some ten turns.
const MAX_AZIMUTHS: usize = 4_000;
const TURNS: usize = 2;

#[derive(Clone, Debug, Default)]
pub struct ConfigurationEstimate {
    last: Option<u16>,
    /// Encoder counts from one azimuth to the next in a turn.
    steps: Vec<u16>,
    /// The times of the starts of turns, ns.
    begins_ns: Vec<i64>,
    bins: usize,
    /// Azimuths of a turn, where turns arrive as a whole.
    azimuths: Option<u16>,
}

impl ConfigurationEstimate {
    /// Adds a message that arrived at this time, ns. A damaged one is ignored.
    pub fn add_message(&mut self, message: &PacketMessage, arrival_ns: i64) {
        match message.azimuth() {
            Ok(Some(azimuth)) => self.add(azimuth.encoder, azimuth.powers.bins(), arrival_ns),
            Ok(None) => {}
            Err(_) => return,
        }
        if let PacketMessage::Turn(turn) = message {
            let (rows, bins) = (turn.encoder_values.len(), turn.b_scan_img.width as usize);
            self.add_turn(rows, bins, arrival_ns);
        }
    }

    fn add_turn(&mut self, rows: usize, bins: usize, arrival_ns: i64) {
        if let Ok(rows @ 1..) = u16::try_from(rows) {
            self.azimuths = Some(rows);
            self.bins = self.bins.max(bins);
            self.begins_ns.push(arrival_ns);
        }
    }

    fn add(&mut self, encoder: u16, bins: usize, arrival_ns: i64) {
        self.bins = self.bins.max(bins);
        let Some(last) = self.last.replace(encoder) else {
            return;
        };
        if encoder < last {
            self.begins_ns.push(arrival_ns);
        } else if encoder > last && self.steps.len() < MAX_AZIMUTHS {
            self.steps.push(encoder - last);
        }
    }

    /// Returns the configuration of a radar with so many encoder counts per turn and this depth of
    /// a range bin, m; `None` before two whole turns.
    pub fn configuration(
        &self,
        encoder_counts: u16,
        range_resolution_m: f32,
    ) -> Option<Configuration> {
        let (first_ns, last_ns) = match self.begins_ns[..] {
            [first, .., last] if self.begins_ns.len() > TURNS => (first, last),
            _ => return None,
        };
        let turns = self.begins_ns.len() as f64 - 1.0;
        let period_s = (last_ns - first_ns) as f64 * 1e-9 / turns;
        let azimuths = match self.azimuths {
            Some(azimuths) => azimuths,
            None => (f64::from(encoder_counts) / self.step()?).round() as u16,
        };
        Some(Configuration {
            azimuth_samples: azimuths,
            range_in_bins: u16::try_from(self.bins).ok()?,
            encoder_size: encoder_counts,
            rotation_mhz: (1000.0 / period_s).round() as u16,
            range_resolution_m: Some(range_resolution_m),
            ..Configuration::default()
        })
    }

    /// Returns the mean step, without those over azimuths that were lost.
    fn step(&self) -> Option<f64> {
        let mut sorted = self.steps.clone();
        sorted.sort_unstable();
        let median = f64::from(*sorted.get(sorted.len() / 2)?);
        let single = sorted.iter().map(|step| f64::from(*step));
        let single: Vec<f64> = single.filter(|step| *step < 1.5 * median).collect();
        Some(single.iter().sum::<f64>() / single.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_azimuths_and_the_time_of_a_turn_are_estimated_from_azimuths() {
        for (counts, lost) in [(5600, 0), (5600, 8), (5595, 0), (5595, 31)] {
            let mut estimate = ConfigurationEstimate::default();
            for azimuth in 0..400 * 4_i64 {
                if lost > 0 && azimuth % lost == 3 {
                    continue;
                }
                let encoder = (azimuth % 400 * counts / 400) as u16;
                assert_eq!(estimate.configuration(counts as u16, 0.04), None);
                estimate.add(encoder, 3768, azimuth * 625_000);
                if azimuth == 1_200 {
                    break;
                }
            }
            let found = estimate.configuration(counts as u16, 0.04).unwrap();
            assert_eq!(found.azimuth_samples, 400, "{counts} {lost}");
            assert_eq!(found.range_in_bins, 3768);
            assert_eq!(found.rotation_mhz, 4000);
            found.check().unwrap();
        }
    }

    #[test]
    fn rows_and_time_are_estimated_from_turns() {
        let mut estimate = ConfigurationEstimate::default();
        for turn in 0..3 {
            assert_eq!(estimate.configuration(5595, 0.04), None, "{turn}");
            estimate.add_turn(400, 3768, turn * 250_000_000);
        }
        let found = estimate.configuration(5595, 0.04).unwrap();
        assert_eq!((found.azimuth_samples, found.range_in_bins), (400, 3768));
        assert_eq!((found.rotation_mhz, found.encoder_size), (4000, 5595));
        found.check().unwrap();
    }
}
