//! The scans of a recording, registered by odometry in this process.

use std::ops::Range;

use gyre_configuration::{
    Configuration, describe_masks_in_process,
    terminal::{Failure, print},
};
use gyre_datasets::{Dataset, ScanSamples};
use gyre_geometry::{OwnedScan, Twist};
use gyre_matching::odometry::{Odometry, Outcome};
use gyre_slam::localisation::Observation;

pub struct Scans {
    dataset: Box<dyn Dataset>,
    /// The scans that are left.
    pub played: Range<usize>,
    odometry: Odometry,
    scan: OwnedScan,
    samples: ScanSamples,
    pub left_out: usize,
    /// Scans in a row that were left out, and the most that may be.
    unreadable: usize,
    max_unreadable: usize,
}

pub struct RegisteredScan<'a> {
    pub number: usize,
    pub observation: Observation<'a>,
    /// The chain of motions starts with it: nothing is known of the motion since the scan before.
    pub starts: bool,
}

impl Scans {
    pub fn open(configuration: &Configuration) -> Result<Self, Failure> {
        let played = gyre_configuration::open(configuration)?;
        let dataset = played.dataset;
        describe_masks_in_process(configuration)?
            .iter()
            .for_each(print::note);
        Ok(Self {
            played: configuration.source.played(dataset.scans()),
            odometry: Odometry::new(&configuration.odometry)?,
            scan: OwnedScan::with_limits(dataset.limits()),
            samples: played.samples,
            left_out: 0,
            unreadable: 0,
            max_unreadable: configuration.source.max_unreadable,
            dataset,
        })
    }

    /// Registers the next scan that can be read; `None` after the last one.
    pub fn register_next(&mut self) -> Result<Option<RegisteredScan<'_>>, Failure> {
        while let Some(number) = self.played.next() {
            let registered = match self.dataset.read(number, self.scan.slot()) {
                Ok(geometry) => {
                    self.scan.geometry = geometry;
                    let scan = self.scan.view();
                    let samples = self.samples.of(self.dataset.as_ref(), scan.span_ns());
                    let registered = self.odometry.register(&scan, &samples);
                    registered.map_err(|error| format!("scan {number}: {error}"))
                }
                Err(error) => Err(error.to_string()),
            };
            let registered = match registered {
                Ok(registered) => registered,
                Err(reason) => {
                    self.leave_out(&reason)?;
                    continue;
                }
            };
            self.unreadable = 0;
            let starts = registered.outcome == Outcome::Start;
            let interval_s = registered.interval_ns as f64 * 1e-9;
            let twist = match starts {
                true => Twist::default(),
                false => Twist::from_chord(&registered.motion.motion, interval_s),
            };
            let observation = Observation {
                stamp_ns: self.scan.geometry.stamp_ns,
                points: self.odometry.points(),
                twist,
                motion: registered.motion.alone(),
            };
            return Ok(Some(RegisteredScan {
                number,
                observation,
                starts,
            }));
        }
        Ok(None)
    }

    /// Registers scans that are spread evenly over those that are left, each by the scan before
    /// alone, and returns whether `is_found` holds for one of them.
    pub fn any_of(
        mut self,
        probes: usize,
        mut is_found: impl FnMut(&Observation<'_>) -> bool,
    ) -> Result<bool, Failure> {
        let step = self.played.len().div_ceil(probes).max(1);
        for number in self.played.clone().skip(step / 2).step_by(step) {
            self.odometry.restart();
            self.played = number.saturating_sub(1)..number + 1;
            while let Some(scan) = self.register_next()? {
                if scan.number == number && is_found(&scan.observation) {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    fn leave_out(&mut self, reason: &str) -> Result<(), Failure> {
        self.left_out += 1;
        self.unreadable += 1;
        if self.unreadable > self.max_unreadable {
            let scans = self.unreadable;
            return Err(format!("{scans} scans in a row cannot be used (source.max_unreadable), the last one: {reason}").into());
        }
        print::note(format_args!("left out: {reason}"));
        Ok(())
    }
}
