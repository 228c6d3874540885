//! Faults to inject into the played scans: `source.faults`.

use gyre_contract::{
    ScanHeader,
    run::{PlayedFault, PlayedFaultKind},
};
use gyre_datasets::ScanSamples;
use gyre_geometry::samples::{Sample, SampleKind};
use gyre_transport::RunError;

#[derive(Clone, Debug)]
pub struct Faults {
    faults: Vec<PlayedFault>,
    /// The stamp of the first scan that is played, ns since 1970.
    first_ns: i64,
}

impl Faults {
    pub fn of(faults: Vec<PlayedFault>, first_ns: Option<i64>) -> Result<Self, RunError> {
        match (first_ns, faults.is_empty()) {
            (None, false) => Err(RunError::Input(
                "source.faults cannot be put into this recording, since the times of its scans are not known before they are read"
                    .to_owned(),
            )),
            (first_ns, _) => Ok(Self {
                faults,
                first_ns: first_ns.unwrap_or_default(),
            }),
        }
    }

    pub fn put_into(&self, samples: ScanSamples) -> Result<ScanSamples, RunError> {
        let is_of_samples = |fault: &PlayedFault| fault.kind != PlayedFaultKind::RadarBlind;
        if !self.faults.iter().any(is_of_samples) {
            return Ok(samples);
        }
        match samples {
            ScanSamples::Recorded(_) => Err(RunError::Input(
                "source.faults of gyro and wheels are put into their logs, and the recording of a run has none: play what it was recorded from, or keep `radar-blind` alone"
                    .to_owned(),
            )),
            samples => Ok(samples.changed(|sample| self.spoilt(sample))),
        }
    }

    fn spoilt(&self, sample: &Sample) -> Option<Sample> {
        let mut spoilt = *sample;
        for fault in self.at(sample.stamp_ns) {
            match fault.kind {
                PlayedFaultKind::GyroOut if sample.is(SampleKind::Gyro) => return None,
                PlayedFaultKind::WheelsSlip if sample.is(SampleKind::Wheels) => {
                    spoilt.values[0] *= 1.0 + PlayedFaultKind::SLIP_SHARE;
                }
                PlayedFaultKind::ClockJump => {
                    spoilt.stamp_ns += (PlayedFaultKind::JUMP_S * 1e9) as i64;
                }
                _ => {}
            }
        }
        spoilt.is_valid().then_some(spoilt)
    }

    pub fn blind(&self, header: &ScanHeader, bytes: &mut [u8]) {
        let is_blind = |fault: &PlayedFault| fault.kind == PlayedFaultKind::RadarBlind;
        if !self.at(header.item.stamp_ns).any(is_blind) {
            return;
        }
        let (first, stride) = (header.first_byte as usize, header.stride as usize);
        for row in 0..header.azimuths as usize {
            let from = first + row * stride;
            if let Some(powers) = bytes.get_mut(from..from + header.bins as usize) {
                powers.fill(0);
            }
        }
    }

    fn at(&self, stamp_ns: i64) -> impl Iterator<Item = &PlayedFault> {
        let time_s = (stamp_ns - self.first_ns) as f64 * 1e-9;
        self.faults.iter().filter(move |fault| fault.is_at(time_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST_NS: i64 = 1_000_000_000_000;

    fn faults(kind: PlayedFaultKind) -> Faults {
        let fault = PlayedFault {
            kind,
            from_s: 4.0,
            for_s: 3.0,
        };
        Faults::of(vec![fault], Some(FIRST_NS)).expect("a stamp")
    }

    fn at(time_s: f64) -> i64 {
        FIRST_NS + (time_s * 1e9) as i64
    }

    #[test]
    fn each_fault_changes_the_samples_of_its_sensor_in_its_time_alone() {
        let (turn, speed) = (
            |time_s| Sample::yaw_rate(at(time_s), 0.1),
            |time_s| Sample::speed(at(time_s), 10.0),
        );
        let out = faults(PlayedFaultKind::GyroOut);
        let slip = faults(PlayedFaultKind::WheelsSlip);
        let jump = faults(PlayedFaultKind::ClockJump);
        for time_s in [0.0, 3.99, 7.0, 20.0] {
            for faults in [&out, &slip, &jump] {
                for sample in [turn(time_s), speed(time_s)] {
                    assert_eq!(faults.spoilt(&sample), Some(sample));
                }
            }
        }
        for time_s in [4.0, 6.99] {
            assert_eq!(out.spoilt(&turn(time_s)), None);
            assert_eq!(out.spoilt(&speed(time_s)), Some(speed(time_s)));
            let fast = Sample::speed(at(time_s), 13.0);
            assert_eq!(slip.spoilt(&speed(time_s)), Some(fast));
            assert_eq!(slip.spoilt(&turn(time_s)), Some(turn(time_s)));
            let ahead = jump.spoilt(&turn(time_s)).map(|it| it.stamp_ns);
            assert_eq!(ahead, Some(turn(time_s).stamp_ns + 1_000_000_000));
        }
    }

    #[test]
    fn a_blind_radar_shows_nothing_and_what_lies_between_the_rows_stays() {
        let mut header = ScanHeader {
            azimuths: 2,
            bins: 3,
            stride: 5,
            first_byte: 2,
            ..ScanHeader::default()
        };
        let shown = |time_s: f64, header: &mut ScanHeader| {
            let mut bytes = [7; 10];
            header.item.stamp_ns = at(time_s);
            faults(PlayedFaultKind::RadarBlind).blind(header, &mut bytes);
            bytes
        };
        assert_eq!(shown(3.9, &mut header), [7; 10]);
        let expected = [7, 7, 0, 0, 0, 7, 7, 0, 0, 0];
        assert_eq!(shown(4.1, &mut header), expected);
    }

    #[test]
    fn faults_that_cannot_be_put_into_a_recording_are_refused() {
        let fault = PlayedFault::default();
        assert!(Faults::of(vec![fault], None).is_err());
        assert!(Faults::of(Vec::new(), None).is_ok());
        let recorded = || ScanSamples::Recorded(vec![SampleKind::Gyro]);
        let put = |kind| faults(kind).put_into(recorded()).is_ok();
        assert!(!put(PlayedFaultKind::ClockJump));
        assert!(put(PlayedFaultKind::RadarBlind));
    }
}
