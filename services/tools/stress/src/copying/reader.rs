//! The readers of a hand-over.

use std::{
    hint::black_box,
    time::{Duration, Instant},
};

use gyre_stage::{
    clock,
    hand_over::Parcel,
    observer::{Next, ObservedRun},
};

use super::{HandOver, Medium, Readings, WARM_UP, cpu_ns, own_bytes, socket};
use crate::{
    StressError,
    helper::{say_ready, say_result},
    load::touched,
};

/// Time without a message after which none is expected any more.
const LIMIT: Duration = Duration::from_secs(20);

/// Reads the messages of a hand-over.
pub(crate) fn read(plan: &HandOver) -> Result<(), StressError> {
    let log = match plan.medium {
        Medium::SharedMemory => read_in_place(plan)?,
        Medium::Sockets => read_copies(plan)?,
    };
    say_result(&log.finish())
}

fn read_in_place(plan: &HandOver) -> Result<ReadLog, StressError> {
    let place = &plan.place;
    let place = place.canonicalize().map_err(StressError::file(place))?;
    let run = ObservedRun::writing_to(&place)?;
    let mut parcels = run.observe::<Parcel>()?;
    say_ready();
    let mut log = ReadLog::new(plan);
    while !log.are_complete() {
        let Next::Message(parcel, _) = parcels.next(LIMIT)? else {
            break;
        };
        let item = *parcel.item();
        let sent_ns = item.hops[Parcel::HOP as usize].published_ns;
        log.add(item.seq, sent_ns, parcel.values());
    }
    Ok(log)
}

fn read_copies(plan: &HandOver) -> Result<ReadLog, StressError> {
    let mut stream = socket::Receiver::connect(plan)?;
    say_ready();
    let mut log = ReadLog::new(plan);
    let deadline = || Instant::now() + LIMIT;
    while !log.are_complete() {
        let Some(message) = stream.next(deadline())? else {
            break;
        };
        log.add(message.number, message.sent_ns, message.content);
    }
    Ok(log)
}

/// The messages that a reader has read so far.
struct ReadLog {
    messages: u64,
    readings: Readings,
    next: u64,
    began_ns: u64,
}

impl ReadLog {
    fn new(plan: &HandOver) -> Self {
        Self {
            messages: plan.messages,
            readings: Readings::default(),
            next: 0,
            began_ns: 0,
        }
    }

    fn are_complete(&self) -> bool {
        self.next >= WARM_UP + self.messages
    }

    /// Reads a message, a byte of each cache line.
    fn add(&mut self, number: u64, sent_ns: i64, bytes: &[u8]) {
        black_box(touched(bytes));
        let after_ns = clock::now_ns() - sent_ns;
        self.next = number + 1;
        match number.checked_sub(WARM_UP) {
            Some(measured) => self.readings.after_ns.push((measured, after_ns)),
            // All that follows is measured.
            None => self.began_ns = cpu_ns(),
        }
    }

    fn finish(mut self) -> Readings {
        self.readings.cpu_ns = cpu_ns() - self.began_ns;
        self.readings.own_bytes = own_bytes();
        self.readings
    }
}
