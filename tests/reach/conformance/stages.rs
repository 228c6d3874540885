//! Stages that keep the contract but for one clause of it. Their results are constant: only the
//! contract matters here.

use std::{env, fs, io, thread, time::Duration};

use gyre_contract::{
    Hop, Item, Masked, MaskedHeader, Message, Motion, Rotation, RotationHeader, Scan, StageId,
    flag, run::StageCounters,
};
use gyre_stage::Launch;
use gyre_supervise::rig::{Recorded, Tap};
use gyre_transport::{RunError, clock, run::STANDBY, writer::TopicWriter};

/// The environment variable with the fault of a stage.
pub const BREACH: &str = "GYRE_TEST_BREACH";

const WRONG: u64 = 5;
const REST: Duration = Duration::from_millis(2);
/// The items that one answers which then answers no more.
const ENOUGH: u64 = 3;
/// The work of one that is slow.
const SLOW: Duration = Duration::from_millis(300);
/// The work of one that does not stamp it.
const HIDDEN: Duration = Duration::from_millis(120);
/// Messages for each item of one that sends too many.
const FLOOD: usize = 500;

/// Works as the rotation search, or for a breach of masking as masking.
pub fn play(launch: &Launch, breach: &str) -> Result<StageCounters, RunError> {
    if breach == "does not wait" && env::var_os(STANDBY).is_some() {
        let ready = launch.manifest.root.join("rotation-search.ready");
        fs::write(ready, "").map_err(|error| RunError::Input(error.to_string()))?;
    }
    let silently = breach == "joins silently";
    let is_masking = breach.starts_with("masking ");
    let (input, output) = match is_masking {
        true => (Scan::ENTRY, Masked::ENTRY),
        false => (Masked::ENTRY, Rotation::ENTRY),
    };
    let (node, manifest) = (&launch.node, &launch.manifest);
    let tap = |topic| match silently {
        true => Tap::silent(topic, node, manifest),
        false => Tap::to(topic, node, manifest),
    };
    let motions = is_masking.then(|| tap(Motion::ENTRY)).transpose()?;
    let mut stage = Broken {
        launch,
        breach,
        stage: match is_masking {
            true => StageId::Masking,
            false => StageId::RotationSearch,
        },
        input: tap(input)?,
        motions,
        newest_motion: None,
        output: TopicWriter::to(output, node, manifest)?,
        next: None,
        waiting: None,
        begun: false,
        ended: false,
        answered: 0,
    };
    stage.run()?;
    Ok(StageCounters::default())
}

struct Broken<'a> {
    launch: &'a Launch,
    breach: &'a str,
    stage: StageId,
    input: Tap,
    motions: Option<Tap>,
    newest_motion: Option<u64>,
    output: TopicWriter,
    next: Option<u64>,
    waiting: Option<Recorded>,
    begun: bool,
    ended: bool,
    /// Items that it has answered.
    answered: u64,
}

impl Broken<'_> {
    fn does(&self, breach: &str) -> bool {
        self.breach == breach
    }

    fn run(&mut self) -> Result<(), RunError> {
        loop {
            let stops = self.launch.signals.sleep(REST)?;
            if (stops && !self.does("hangs")) || (self.ended && self.does("leaves at the end")) {
                return Ok(());
            }
            if !self.does("gives no history") {
                self.output.answer_handshakes()?;
            }
            while self.receive_motion()? {}
            while !self.ended && self.advance()? {}
        }
    }

    fn receive_motion(&mut self) -> Result<bool, RunError> {
        let motion = self.motions.as_ref().map(Recorded::receive).transpose()?;
        let Some(motion) = motion.flatten() else {
            return Ok(false);
        };
        self.newest_motion = self.newest_motion.max(Some(motion.item().seq));
        Ok(true)
    }

    /// Processes the next item; returns whether there was one.
    fn advance(&mut self) -> Result<bool, RunError> {
        let Some(message) = self.receive()? else {
            return Ok(false);
        };
        let item = message.item();
        if self.next.is_some_and(|next| item.seq < next) {
            return Ok(true);
        }
        if let Some(expected) = self.next.filter(|next| item.seq > *next)
            && !self.does("swallows")
        {
            return Err(RunError::gap("of the test", expected, item.seq));
        }
        if !self.has_motion(item.seq) {
            self.waiting = Some(message);
            return Ok(false);
        }
        self.next = Some(item.seq + 1);
        let may_begin = item.is(flag::BREAK) || !self.does("needs the first item");
        self.begun |= may_begin;
        match item.is(flag::END) {
            _ if !self.begun => {}
            true => self.end(&item)?,
            false if self.answered >= ENOUGH && self.does("falls silent") => {}
            false if self.answered >= ENOUGH && self.does("dies") => {
                return Err(RunError::Input("no memory is left".to_owned()));
            }
            false => self.process(&item, message.received_ns)?,
        }
        self.answered += 1;
        Ok(true)
    }

    fn receive(&mut self) -> Result<Option<Recorded>, RunError> {
        if let Some(message) = self.waiting.take() {
            return Ok(Some(message));
        }
        match Recorded::receive(&self.input) {
            Err(RunError::Malformed { .. }) if self.does("swallows") => Ok(None),
            received => received,
        }
    }

    /// Masking that is too patient waits for the motion of the item before, and one that is not
    /// waits for none.
    fn has_motion(&self, seq: u64) -> bool {
        let before = seq.checked_sub(1);
        !self.does("masking too patient") || before.is_none() || self.newest_motion >= before
    }

    fn process(&self, item: &Item, received_ns: i64) -> Result<(), RunError> {
        if self.does("skips") && item.seq == WRONG {
            return Ok(());
        }
        let mut now_ns = clock::now_ns();
        let mut received_ns = received_ns;
        if self.does("is slow") {
            thread::sleep(SLOW);
        }
        if self.does("hides its work") {
            thread::sleep(HIDDEN);
            (received_ns, now_ns) = (clock::now_ns(), clock::now_ns());
        }
        let mut item = *item;
        if !self.does("stamps nothing") {
            *item.hop_mut(self.stage) = Hop {
                received_ns,
                started_ns: now_ns,
                finished_ns: clock::now_ns(),
                published_ns: clock::now_ns(),
            };
        }
        if self.does("forgets the item") {
            item.stamp_ns = 0;
        }
        let output = self.output_about(item)?;
        output.send(&self.output)?;
        let copies = match self.breach {
            "sends twice" if item.seq == WRONG => 1,
            "floods" => FLOOD,
            _ => 0,
        };
        (0..copies).try_for_each(|_| output.send(&self.output))
    }

    fn output_about(&self, item: Item) -> Result<Recorded, RunError> {
        if self.stage == StageId::Masking {
            return Ok(self.mask(item));
        }
        let mut header = RotationHeader {
            item,
            ..RotationHeader::default()
        };
        if self.does("is not deterministic") {
            header.rotation.score = clock::now_ns() as f64;
        }
        let is_wrong = match self.breach {
            "sends NaN" => item.seq == WRONG,
            "sends only NaN" => true,
            // Of all its processes in a run, the first one alone.
            "sends NaN once" => item.seq == WRONG && self.is_first()?,
            _ => false,
        };
        if is_wrong {
            header.rotation.angle_rad = f64::NAN;
        }
        Ok(Recorded::of::<Rotation>(&header, &[], 0))
    }

    /// Returns whether this has not been asked before in the run.
    fn is_first(&self) -> Result<bool, RunError> {
        match fs::File::create_new(self.launch.manifest.out.join("asked")) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            created => created
                .map(|_| true)
                .map_err(|error| RunError::Input(error.to_string())),
        }
    }

    fn mask(&self, item: Item) -> Recorded {
        let limits = self.launch.manifest.limits;
        let header = MaskedHeader {
            item,
            n: limits.side() as u32,
            rasters: 1,
            cell_m: limits.cell_m,
            compensated: 1,
            ..MaskedHeader::default()
        };
        Recorded::of::<Masked>(&header, &vec![0; limits.raster_cells * 4], 0)
    }

    fn end(&mut self, item: &Item) -> Result<(), RunError> {
        self.ended = true;
        if self.does("keeps the end") {
            return Ok(());
        }
        self.output_about(*item)?.send(&self.output)
    }
}
