//! The inputs of masking: a scan and the motion for its motion compensation.

use gyre_contract::{Commands, Item, Scan, Window, flag};
use gyre_geometry::{
    LostAzimuths, Twist,
    samples::{AllEvidence, Sample, SampledSensors},
};
use gyre_stage::{
    Launch,
    inputs::{Action, Inputs},
};
use gyre_transport::{Listener, RunError, reader::Received};

use crate::masking::{
    commands::AppliedCommands,
    live::NewestOnly,
    lossless::{InOrder, Queue},
    motions::Motions,
};

pub struct Scans {
    queue: Box<dyn Queue>,
    commands: AppliedCommands,
    motions: Motions,
    sensors: SampledSensors,
    sampled: Option<u64>,
    /// True if a chain of motions starts with the current scan.
    starts_chain: bool,
    window: Window,
    /// The velocities for the current and for the previous scan.
    found: [Option<Twist>; 2],
    lost: [Option<LostAzimuths>; 2],
}

pub struct ScanView<'a> {
    pub current: MovedScan<'a>,
    pub previous: Option<MovedScan<'a>>,
    /// Of the sensors whose samples come with the scans.
    pub evidence: AllEvidence,
}

pub struct MovedScan<'a> {
    pub scan: &'a Received<Scan>,
    /// The velocity for its motion compensation: of the motion of the scan `lag` scans earlier,
    /// with the yaw rate of the gyro; `None` without such a motion.
    pub twist: Option<Twist>,
    /// Where its azimuths were lost, if it has a pose from before a restart.
    pub lost: Option<LostAzimuths>,
}

impl Inputs for Scans {
    type View<'a> = ScanView<'a>;

    fn open(launch: &Launch) -> Result<Self, RunError> {
        let motions = Motions::open(launch)?;
        let queue: Box<dyn Queue> = match launch.manifest.live {
            false => Box::new(InOrder::open(launch)?),
            true => Box::new(NewestOnly::open(launch)?),
        };
        let commands = Commands::open(&launch.manifest.out).map_err(RunError::input)?;
        Ok(Self {
            queue,
            commands: AppliedCommands::new(
                commands,
                (!launch.manifest.live).then_some(launch.manifest.window),
            ),
            starts_chain: false,
            motions,
            sensors: SampledSensors::new(&launch.sensors()?),
            sampled: None,
            window: launch.manifest.window,
            found: [None; 2],
            lost: [None; 2],
        })
    }

    fn next_action(&mut self) -> Result<Action, RunError> {
        self.queue.receive()?;
        self.motions.update()?;
        // The newest pose decides which scans are still needed, and in live mode where the chain
        // resumes.
        let Some(resume_at) = self.motions.credit.resume_at else {
            return Ok(Action::Wait);
        };
        let newest_pose = self.motions.credit.newest;
        let action = self.queue.next_action(&resume_at, newest_pose)?;
        match action {
            Action::Process(item, received_ns) => {
                if !self.find_motions(&item) {
                    return Ok(Action::Wait);
                }
                // Now it is certain that this scan is processed: in live mode a newer one takes the
                // place of one that waits. Where a chain starts, all motions are known.
                let item = self.commands.mark(&item, &resume_at)?;
                self.find_motions(&item);
                // A restarted masking knows from the poses where a reset was.
                self.starts_chain = self.motions.known.starts(item.seq);
                self.take_samples()?;
                return Ok(Action::Process(item, received_ns));
            }
            Action::Keep => {
                self.starts_chain = false;
                self.take_samples()?;
            }
            _ => {}
        }
        Ok(action)
    }

    fn view(&self) -> Option<ScanView<'_>> {
        let [motion, previous_motion] = self.found;
        let [previous_twist, twist] = self.sensors.with_yaw_rates([previous_motion, motion]);
        let [lost, previous_lost] = self.lost;
        let previous = self.queue.previous().filter(|_| !self.starts_chain);
        Some(ScanView {
            current: MovedScan {
                scan: self.queue.current()?,
                twist,
                lost,
            },
            previous: previous.map(|scan| MovedScan {
                scan,
                twist: previous_twist,
                lost: previous_lost,
            }),
            evidence: self.sensors.evidence(),
        })
    }

    fn advance(&mut self) {
        self.queue.advance();
    }

    fn listeners(&self) -> Vec<&Listener> {
        let scans = self.queue.listener();
        // Motions and poses are read when a scan comes.
        if self.queue.current().is_none() && self.motions.credit.resume_at.is_some() {
            return vec![scans];
        }
        let [motions, poses] = self.motions.listeners();
        vec![scans, motions, poses]
    }

    fn duplicates(&self) -> u64 {
        self.queue.duplicates()
    }
}

impl Scans {
    /// Looks up the motions for a scan and the previous one; false while one is missing. They
    /// depend on the numbers alone, so they are the same after a restart.
    fn find_motions(&mut self, item: &Item) -> bool {
        if item.is(flag::BREAK) {
            self.motions.known.insert(item.seq, None);
        }
        let previous = item
            .seq
            .checked_sub(1)
            .filter(|_| self.window.masks_pairs());
        let found = [Some(item.seq), previous]
            .map(|seq| seq.map_or(Some(None), |seq| self.motion_for(seq)));
        self.found = found.map(Option::flatten);
        self.lost = [Some(item.seq), item.seq.checked_sub(1)].map(|seq| self.motions.lost(seq?));
        found.iter().all(Option::is_some)
    }

    /// Hands the samples of the current scan to the sensors, once. Before that it hands over
    /// the samples of the previous scan, if that scan came with a restart, and of the scans dropped
    /// since.
    fn take_samples(&mut self) -> Result<(), RunError> {
        let dropped = self.queue.take_dropped();
        let scans = [self.queue.previous(), self.queue.current()];
        let is_new = |scan: &&Received<Scan>| self.sampled < Some(scan.item().published);
        let [previous, current] = scans.map(|scan| scan.filter(is_new));
        let Some(current) = current else {
            return Ok(());
        };
        match previous {
            _ if self.starts_chain => self.sensors.clear(),
            Some(previous) => {
                let (samples, stamp_ns, span_ns) = samples_of(previous)?;
                self.sensors.push(samples, stamp_ns, span_ns);
            }
            None => self.sensors.drop_scan(&dropped),
        }
        let (samples, stamp_ns, span_ns) = samples_of(current)?;
        self.sensors.push(samples, stamp_ns, span_ns);
        self.sampled = Some(current.item().published);
        Ok(())
    }

    fn motion_for(&self, seq: u64) -> Option<Option<Twist>> {
        match self.window.lag {
            0 => Some(None),
            lag => self.motions.known.before(seq, lag as u64),
        }
    }
}

fn samples_of(received: &Received<Scan>) -> Result<(&[Sample], i64, [i64; 2]), RunError> {
    let (header, bytes) = (received.header(), received.values());
    let parts = header.view(bytes).zip(header.samples(bytes));
    let (scan, samples) =
        parts.ok_or_else(|| received.malformed("its payload is shorter than its header says"))?;
    Ok((samples, scan.geometry.stamp_ns, scan.span_ns()))
}
