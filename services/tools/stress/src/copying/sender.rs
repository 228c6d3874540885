//! The sender of a hand-over.

use gyre_stage::{clock, hand_over, wake::Signals};
use rustix::time::{ClockId, clock_gettime};

use super::{HandOver, Medium, RATE_HZ, Sent, WARM_UP, own_bytes, sending::Send, socket};
use crate::{
    StressError,
    helper::{say_ready, say_result},
};

/// Sends the messages of a hand-over.
pub(crate) fn send(plan: &HandOver) -> Result<(), StressError> {
    let signals = Signals::install()?;
    match plan.medium {
        Medium::SharedMemory => send_by(plan, Loaned::create(plan)?, &signals),
        Medium::Sockets => send_by(plan, socket::Sender::create(plan)?, &signals),
    }
}

fn send_by(plan: &HandOver, mut medium: impl Send, signals: &Signals) -> Result<(), StressError> {
    say_ready();
    await_line();
    medium.begin()?;
    let mut sent = Sent::default();
    let began_ns = clock::now_ns();
    let period_ns = (1e9 / RATE_HZ) as i64;
    for number in 0..WARM_UP + plan.messages {
        sleep_until(signals, began_ns + number as i64 * period_ns)?;
        medium.write(number)?;
        let before_ns = cpu_ns();
        medium.send()?;
        if number >= WARM_UP {
            sent.cpu_ns += cpu_ns() - before_ns;
        }
    }
    sent.own_bytes = own_bytes();
    sent.shared_bytes = medium.shared_bytes();
    say_result(&sent)?;
    // Readers may still read.
    await_line();
    Ok(())
}

/// Waits for a line, or until the process that has started this one has ended.
fn await_line() {
    let _ = std::io::stdin().read_line(&mut String::new());
}

/// Sleeps until a time, unless a signal requests a stop before.
fn sleep_until(signals: &Signals, due_ns: i64) -> Result<(), StressError> {
    loop {
        let left = clock::until(due_ns);
        if left.is_zero() {
            return Ok(());
        }
        if signals.sleep(left)? {
            return Err(StressError::Interrupted);
        }
    }
}

/// Processor time of this thread, ns.
fn cpu_ns() -> u64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    (now.tv_sec * 1_000_000_000 + now.tv_nsec) as u64
}

/// Through shared memory: a message is written where its readers read it.
struct Loaned {
    topic: hand_over::HandOver,
    draft: Option<gyre_stage::writer::Draft<hand_over::Parcel>>,
}

impl Loaned {
    fn create(plan: &HandOver) -> Result<Self, StressError> {
        let place = &plan.place;
        let place = place.canonicalize().map_err(StressError::file(place))?;
        Ok(Self {
            topic: hand_over::HandOver::create(&place, plan.bytes, plan.readers)?,
            draft: None,
        })
    }
}

impl Send for Loaned {
    fn begin(&mut self) -> Result<(), StressError> {
        Ok(self.topic.accept_readers()?)
    }

    fn write(&mut self, number: u64) -> Result<(), StressError> {
        let mut draft = self.topic.loan()?;
        draft.header().item.seq = number;
        draft.values::<u8>().fill(number as u8);
        self.draft = Some(draft);
        Ok(())
    }

    fn send(&mut self) -> Result<(), StressError> {
        match self.draft.take() {
            Some(draft) => Ok(self.topic.send(draft)?),
            None => Ok(()),
        }
    }

    fn shared_bytes(&self) -> u64 {
        self.topic.shared_bytes() as u64
    }
}
