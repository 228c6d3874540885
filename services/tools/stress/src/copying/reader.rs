//! A reader.

use std::{
    hint::black_box,
    time::{Duration, Instant},
};

use gyre_stage::{
    clock,
    hand_over::Parcel,
    observer::{Next, ObservedRun},
};

use super::{Had, Plan, WARM_UP, Way, cpu_ns, own_bytes, socket};
use crate::{
    StressError,
    helper::{say_ready, say_result},
    load::touched,
};

/// Time without a message after which none is expected any more.
const LIMIT: Duration = Duration::from_secs(20);

/// Reads the messages of a plan.
pub(super) fn read(plan: &Plan) -> Result<(), StressError> {
    let had = match plan.way {
        Way::SharedMemory => read_in_place(plan)?,
        Way::Sockets => read_copies(plan)?,
    };
    say_result(&had.finish())
}

fn read_in_place(plan: &Plan) -> Result<Readings, StressError> {
    let place = &plan.place;
    let place = place.canonicalize().map_err(StressError::file(place))?;
    let run = ObservedRun::writing_to(&place)?;
    let mut parcels = run.observe::<Parcel>()?;
    say_ready();
    let mut readings = Readings::new(plan);
    while !readings.are_complete() {
        let Next::Message(parcel, _) = parcels.next(LIMIT)? else {
            break;
        };
        let item = *parcel.item();
        let sent_ns = item.hops[Parcel::HOP as usize].published_ns;
        readings.add(item.seq, sent_ns, parcel.values());
    }
    Ok(readings)
}

fn read_copies(plan: &Plan) -> Result<Readings, StressError> {
    let mut stream = socket::Receiver::connect(plan)?;
    say_ready();
    let mut readings = Readings::new(plan);
    let deadline = || Instant::now() + LIMIT;
    while !readings.are_complete() {
        let Some(message) = stream.next(deadline())? else {
            break;
        };
        readings.add(message.number, message.sent_ns, message.content);
    }
    Ok(readings)
}

/// The messages that a reader has had.
struct Readings {
    messages: u64,
    had: Had,
    next: u64,
    began_ns: u64,
}

impl Readings {
    fn new(plan: &Plan) -> Self {
        Self {
            messages: plan.messages,
            had: Had::default(),
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
            Some(measured) => self.had.after_ns.push((measured, after_ns)),
            // All that follows is measured.
            None => self.began_ns = cpu_ns(),
        }
    }

    fn finish(mut self) -> Had {
        self.had.cpu_ns = cpu_ns() - self.began_ns;
        self.had.own_bytes = own_bytes();
        self.had
    }
}
