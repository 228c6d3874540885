//! The poses between the scans of a live radar: the source has the samples of other sensors first.

use std::{num::NonZeroU64, time::Duration};

use gyre_contract::{PredictedPose, PredictedPoseHeader, StageId, run::RunConfig};
use gyre_geometry::samples::{Sample, SensorConfigs};
use gyre_transport::{
    RunError, clock,
    numbers::{self, Numbers},
    writer::Writer,
};
use rustix::thread::set_current_timer_slack;

use super::Credit;
use crate::Launch;

/// The file with the number of predictions so far: a source that replaces a dead one continues to
/// count.
const SENT: &str = "source.predictions";

pub(super) struct Predictions {
    configs: SensorConfigs,
    output: Writer<PredictedPose>,
    period_ns: i64,
    /// When the next one is due, `CLOCK_MONOTONIC`, ns.
    due_ns: i64,
    /// The sensor's clock minus `CLOCK_MONOTONIC`, ns, by the last scan.
    ahead_ns: Option<i64>,
    sent: Numbers<1>,
    next: u64,
}

impl Predictions {
    /// `None` if the run predicts none.
    pub fn open(launch: &Launch) -> Result<Option<Self>, RunError> {
        let run: RunConfig = launch.section("run")?;
        if run.predict_hz == 0.0 {
            return Ok(None);
        }
        // By default the system ends a wait up to 50 us late. If it refuses, poses are that late.
        let _ = set_current_timer_slack(NonZeroU64::new(1));
        let manifest = &launch.manifest;
        let [next] = numbers::read(&manifest.root.join(SENT)).unwrap_or_default();
        Ok(Some(Self {
            configs: launch.sensors()?,
            output: Writer::open(&launch.node, manifest)?,
            period_ns: (1e9 / run.predict_hz) as i64,
            due_ns: clock::now_ns(),
            ahead_ns: None,
            sent: Numbers::open(manifest, SENT)?,
            next,
        }))
    }

    /// Takes the time of the last azimuth of a scan on the sensor's clock, and when that was by
    /// `CLOCK_MONOTONIC`, both ns.
    pub fn set_clock(&mut self, complete_ns: i64, due_ns: i64) {
        self.ahead_ns = Some(complete_ns - due_ns);
    }

    pub fn until_due(&self) -> Duration {
        clock::until(self.due_ns)
    }

    /// Publishes the pose of now, if it is due and known. `samples` returns those since a time.
    pub fn publish_due(
        &mut self,
        credit: &Credit,
        samples: impl FnOnce(i64) -> Vec<Sample>,
    ) -> Result<(), RunError> {
        self.output.answer_handshakes()?;
        let now_ns = clock::now_ns();
        if now_ns < self.due_ns {
            return Ok(());
        }
        // Without drift, and without a burst after a pause.
        self.due_ns = (self.due_ns + self.period_ns).max(now_ns);
        let Some((last, ahead_ns)) = credit.last.as_ref().zip(self.ahead_ns) else {
            return Ok(());
        };
        let (start, at_ns) = (last.prediction_start(), now_ns + ahead_ns);
        let samples = samples(start.stamp_ns);
        let Some(predicted) = start.predict(&self.configs, &samples, at_ns) else {
            return Ok(());
        };
        let mut message = PredictedPoseHeader::new(last, &predicted, at_ns);
        message.item.seq = self.next;
        message.item.due_ns = now_ns;
        self.next += 1;
        // In this order a death in between leaves a number without a message, which counts as lost.
        self.sent.write([self.next])?;
        self.output.publish(message, Some(StageId::RadarReplay))
    }
}
