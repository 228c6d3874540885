//! A radar behind its driver as the source of a run.

use std::{
    mem,
    os::fd::BorrowedFd,
    time::{Duration, Instant},
};

use gyre_client::{RunError, clock};
use gyre_contract::{GnssHeader, ScanHeader, StageId, control::Received};
use gyre_geometry::samples::{Sample, SampleKind};
use gyre_ros2_messages::{navtech_msgs::RadarBScanMsg, radar::DescribedRadar};
use gyre_stage::source::{Arrival, Sensor};
use gyre_stages::live_radar::{Intake, NoScans};
use ros2_client::Gid;

use super::{
    Settings,
    configuration_estimate::ConfigurationEstimate,
    driver::{Driver, Packet, PacketMessage},
};

const MAX_MESSAGES: usize = 512;
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// Time after which a configuration is estimated: the driver sends it every four turns.
const CONFIGURATION_WAIT: Duration = Duration::from_secs(3);
/// Time without an azimuth of a publisher after which a different publisher takes its place.
const PUBLISHER_WAIT: Duration = Duration::from_secs(1);

pub struct Radar {
    settings: Settings,
    driver: Driver,
    intake: Intake,
    /// The configuration so far, which a driver that was started again need not repeat.
    described: Option<DescribedRadar>,
    estimate: ConfigurationEstimate,
    opened: Instant,
    /// A turn, and how many of its rows were added: a scan can be complete before its end.
    turn: Option<(RadarBScanMsg, usize)>,
    /// Who publishes the azimuths, and the number of publishers so far.
    publisher: Option<Gid>,
    publishers: u64,
    last_azimuth: Instant,
    is_silent: bool,
}

impl Radar {
    pub fn open(settings: Settings) -> Result<Self, RunError> {
        let now = Instant::now();
        Ok(Self {
            intake: Intake::new(settings.constants),
            driver: Driver::open(&settings)?,
            settings,
            described: None,
            estimate: ConfigurationEstimate::default(),
            opened: now,
            turn: None,
            publisher: None,
            publishers: 0,
            last_azimuth: now,
            is_silent: false,
        })
    }

    fn take_configuration(&mut self, room: usize) -> Result<(), RunError> {
        for _ in 0..MAX_MESSAGES {
            match self.driver.configuration() {
                Ok(Some(described)) => self.configure(described, room)?,
                Ok(None) => break,
                Err(error) => self.intake.damaged(error, 0),
            }
        }
        Ok(())
    }

    fn configure(&mut self, described: DescribedRadar, room: usize) -> Result<(), RunError> {
        self.described = Some(described);
        match self.intake.configure(described.radar, room) {
            Err(error @ NoScans::TooLarge { .. }) => Err(RunError::Input(error.to_string())),
            Err(error @ NoScans::Bad(_)) => {
                self.intake.damaged(error, 0);
                Ok(())
            }
            Ok(_) => Ok(()),
        }
    }

    fn add(
        &mut self,
        packet: Packet,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Result<bool, RunError> {
        if !self.takes(packet.publisher, bytes.len())? {
            return Ok(false);
        }
        let arrival_ns = packet.message.arrival_ns();
        if !self.intake.is_configured() {
            self.estimate(&packet.message, arrival_ns, bytes.len())?;
        }
        if let PacketMessage::Turn(turn) = packet.message {
            return Ok(self.add_turn(turn, 0, header, bytes));
        }
        match packet.message.azimuth() {
            Ok(Some(azimuth)) => return Ok(self.intake.add(azimuth, arrival_ns, header, bytes)),
            Ok(None) => {}
            Err(error) => self.intake.damaged(error, 0),
        }
        Ok(false)
    }

    /// Adds the rows of a turn from number `from` on; true if a scan is complete. Without a
    /// configuration they are dropped.
    fn add_turn(
        &mut self,
        turn: RadarBScanMsg,
        from: usize,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> bool {
        let Some(of) = self.described else {
            return false;
        };
        let completed = match turn.rows(&of.radar, of.azimuth_offset, clock::since_1970_ns()) {
            Ok(rows) => rows.enumerate().skip(from).find_map(|(index, row)| {
                let is_complete = self.intake.add(row.azimuth, row.arrived_ns, header, bytes);
                is_complete.then_some(index + 1)
            }),
            Err(error) => {
                self.intake.damaged(error, 0);
                None
            }
        };
        self.turn = completed.map(|rows| (turn, rows));
        completed.is_some()
    }

    /// Returns whether this publisher is the one that is received. A different publisher takes its
    /// place when it has fallen silent: the driver was restarted, and its messages do not continue
    /// the scan before.
    fn takes(&mut self, publisher: Gid, room: usize) -> Result<bool, RunError> {
        let silent = self.last_azimuth.elapsed();
        match self.publisher {
            Some(current) if current == publisher => {}
            Some(_) if silent < PUBLISHER_WAIT => {
                let reason =
                    "two publishers send azimuths on the topic, and only the first is received";
                self.intake.damaged(reason, 0);
                return Ok(false);
            }
            _ => {
                self.publisher = Some(publisher);
                self.publishers += 1;
                self.intake.restart();
                if let Some(described) = self.described {
                    self.configure(described, room)?;
                }
            }
        }
        self.last_azimuth = Instant::now();
        if mem::take(&mut self.is_silent) {
            let topic = &self.settings.topic;
            tracing::info!(topic, "azimuths arrive again after {silent:.1?}");
        }
        Ok(true)
    }

    /// Estimates the configuration from azimuths if the driver publishes no configuration.
    fn estimate(
        &mut self,
        message: &PacketMessage,
        arrival_ns: i64,
        room: usize,
    ) -> Result<(), RunError> {
        self.estimate.add_message(message, arrival_ns);
        let is_due = self.opened.elapsed() >= CONFIGURATION_WAIT;
        let resolution_m = self.settings.constants.range_resolution_m;
        let counts = self.settings.encoder_counts;
        let estimated = |resolution_m| self.estimate.configuration(counts, resolution_m);
        let Some(radar) = resolution_m.filter(|_| is_due).and_then(estimated) else {
            return Ok(());
        };
        let (azimuths, bins) = (radar.azimuth_samples, radar.range_in_bins);
        tracing::info!(
            azimuths,
            bins,
            "the driver publishes no configuration: it was found from azimuths"
        );
        let described = DescribedRadar {
            radar,
            azimuth_offset: 0,
        };
        self.configure(described, room)
    }

    /// Returns how to wait for more. Silence is reported once.
    fn wait(&mut self, has_received: bool) -> Arrival {
        let silence = self.settings.silence;
        let left = silence.saturating_sub(self.last_azimuth.elapsed());
        if left.is_zero() && !mem::replace(&mut self.is_silent, true) {
            let topic = &self.settings.topic;
            tracing::warn!(
                topic,
                "no azimuth for {silence:?}: check that the driver runs and that the radar is on"
            );
        }
        match self.intake.pause().filter(|_| has_received) {
            Some(pause) => Arrival::Later(pause),
            None if self.is_silent => Arrival::Nothing(silence),
            None => Arrival::Nothing(left),
        }
    }
}

impl Sensor for Radar {
    const HOP: StageId = StageId::RadarReplay;

    fn connection(&self) -> Option<BorrowedFd<'_>> {
        Some(self.driver.wakeups.descriptor())
    }

    fn take(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<Arrival, RunError> {
        let is_received = self.driver.receive()?;
        self.driver.wakeups.clear()?;
        self.take_configuration(bytes.len())?;
        if let Some((turn, rows)) = self.turn.take()
            && self.add_turn(turn, rows, header, bytes)
        {
            return Ok(Arrival::Scan);
        }
        for taken in 0..MAX_MESSAGES {
            match self.driver.packet() {
                Ok(Some(packet)) => {
                    if self.add(packet, header, bytes)? {
                        return Ok(Arrival::Scan);
                    }
                }
                Ok(None) if !is_received => {
                    self.wait(false);
                    return Ok(Arrival::Nothing(POLL_INTERVAL));
                }
                Ok(None) => return Ok(self.wait(taken > 0)),
                Err(error) => self.intake.damaged(error, 0),
            }
        }
        Ok(Arrival::Nothing(Duration::ZERO))
    }

    fn samples(&self) -> Option<BorrowedFd<'_>> {
        Some(self.driver.sample_wakeups.descriptor())
    }

    fn sample(&mut self, of: SampleKind) -> Option<Sample> {
        self.driver.sample_wakeups.clear().ok()?;
        self.driver.sample(of)
    }

    fn fix(&mut self) -> Option<GnssHeader> {
        self.driver.fix()
    }

    fn due_ns(&self) -> Option<i64> {
        self.intake.due_ns()
    }

    fn resume(&mut self, before: Received) {
        self.intake.resume(before);
    }

    fn received(&self) -> Received {
        let mut counts = self.intake.received();
        counts.connections += self.publishers;
        counts.is_receiving = self.publisher.is_some() && !self.is_silent;
        counts
    }
}
