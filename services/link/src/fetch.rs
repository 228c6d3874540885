//! The end of a topic that receives: asks for all messages from one on, and again after each cut.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{Receiver, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};

use gyre_messages::{Item, flag};
use zenoh::{
    Session, Wait,
    qos::{CongestionControl, Priority},
    query::{ConsolidationMode, Reply},
};

use crate::{
    serve::{ANSWERED_FOR, ENDED, FROM, RECEIVER},
    wake::Waker,
};

/// Time after which a request that nobody has ended is made again.
const GIVEN_UP: Duration = ANSWERED_FOR.saturating_add(Duration::from_secs(10));
/// The same for one that is not answered, and for one whose answers cease: a request can be lost at the moment of a cut, without an end. A scan
/// may take seconds on a slow network.
const UNANSWERED: Duration = Duration::from_secs(3);
const SILENT: Duration = Duration::from_secs(12);
/// Time between two looks whether to go on.
const LOOK: Duration = Duration::from_millis(200);
/// Pauses between requests that nobody has answered, from the first to the longest.
const PAUSES: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(1));

/// A topic that is being received, by a thread.
pub(crate) struct Fetcher {
    messages: Receiver<Vec<u8>>,
    state: Arc<State>,
}

struct State {
    stop: AtomicBool,
    again: AtomicBool,
    is_connected: AtomicBool,
    has_ended: AtomicBool,
    /// The first message of the newest request.
    asked: AtomicU64,
    /// The first message of those to come: see [`Fetcher::confirm`].
    confirmed: AtomicU64,
}

/// What is asked for.
pub(crate) struct Request {
    /// The key of the topic.
    pub key: String,
    /// The first message.
    pub from: u64,
    /// Poses go before scans.
    pub priority: Priority,
}

impl Fetcher {
    /// Receives the messages of a topic, and wakes `waker` for each.
    pub fn start(session: &Session, request: Request, waker: Waker) -> Self {
        let (sender, messages) = channel();
        let state = Arc::new(State {
            stop: AtomicBool::new(false),
            again: AtomicBool::new(false),
            is_connected: AtomicBool::new(false),
            has_ended: AtomicBool::new(false),
            asked: AtomicU64::new(request.from),
            confirmed: AtomicU64::new(request.from),
        });
        let asking = Asking {
            session: session.clone(),
            receiver: session.zid().to_string(),
            request,
            sender,
            waker,
            has_end: false,
            state: state.clone(),
        };
        thread::spawn(move || asking.run());
        Self { messages, state }
    }

    /// Returns the next message that has come.
    pub fn next(&self) -> Option<Vec<u8>> {
        self.messages.try_recv().ok()
    }

    /// Tells the other side that all before message `next` has arrived, by asking from there. The end of a stream is asked for again until
    /// it is confirmed.
    pub fn confirm(&self, next: u64) {
        self.state.confirmed.fetch_max(next, Ordering::Relaxed);
        if self.state.asked.load(Ordering::Relaxed) < next {
            self.state.again.store(true, Ordering::Relaxed);
        }
    }

    /// Returns whether no message follows those that have come.
    pub fn has_ended(&self) -> bool {
        self.state.has_ended.load(Ordering::Acquire)
    }

    /// Returns whether the other side answers.
    pub fn is_connected(&self) -> bool {
        self.state.is_connected.load(Ordering::Relaxed)
    }
}

impl Drop for Fetcher {
    fn drop(&mut self) {
        self.state.stop.store(true, Ordering::Relaxed);
    }
}

struct Asking {
    session: Session,
    receiver: String,
    request: Request,
    sender: Sender<Vec<u8>>,
    waker: Waker,
    /// Whether the end of the stream has come.
    has_end: bool,
    state: Arc<State>,
}

impl Asking {
    fn run(mut self) {
        let mut pause = PAUSES.0;
        while !self.has_stopped() {
            match self.ask() {
                true => pause = PAUSES.0,
                false => {
                    self.set_connected(false);
                    thread::sleep(pause);
                    pause = (pause * 2).min(PAUSES.1);
                }
            }
        }
    }

    /// Asks once, and takes the answers until they end; returns whether there were any.
    fn ask(&mut self) -> bool {
        let confirmed = self.state.confirmed.load(Ordering::Relaxed);
        self.request.from = self.request.from.max(confirmed);
        let Request {
            key,
            from,
            priority,
        } = &self.request;
        let selector = format!("{key}?{FROM}={from};{RECEIVER}={}", self.receiver);
        let asked = self
            .session
            .get(selector)
            .consolidation(ConsolidationMode::None)
            .congestion_control(CongestionControl::Block)
            .priority(*priority)
            .timeout(GIVEN_UP)
            .wait();
        let Ok(replies) = asked else {
            return false;
        };
        let mut was_answered = false;
        self.state.asked.store(*from, Ordering::Relaxed);
        self.state.again.store(false, Ordering::Relaxed);
        let mut heard = Instant::now();
        loop {
            match replies.recv_timeout(LOOK) {
                Ok(Some(reply)) => {
                    was_answered |= self.take(reply);
                    heard = Instant::now();
                }
                Ok(None) => {
                    let limit = if was_answered { SILENT } else { UNANSWERED };
                    if heard.elapsed() > limit {
                        return false;
                    }
                }
                Err(_) => return was_answered,
            }
            if self.has_stopped() || self.state.again.load(Ordering::Relaxed) {
                return true;
            }
        }
    }

    /// Takes an answer; false if it is none.
    fn take(&mut self, reply: Reply) -> bool {
        let sample = match reply.into_result() {
            Ok(sample) => sample,
            Err(error) => {
                if &*error.payload().to_bytes() == ENDED.as_bytes() {
                    self.state.has_ended.store(true, Ordering::Release);
                    self.state.stop.store(true, Ordering::Relaxed);
                    self.waker.wake();
                }
                return false;
            }
        };
        self.set_connected(true);
        let bytes = sample.payload().to_bytes().into_owned();
        // The first answer is empty.
        let item = bytes.get(..size_of::<Item>());
        let item = item.map(bytemuck::pod_read_unaligned::<Item>);
        if let Some(item) = item.filter(|item| self.is_new(item)) {
            match item.is(flag::END) {
                true => self.has_end = true,
                false => self.request.from = item.seq.saturating_add(1),
            }
            if self.sender.send(bytes).is_err() {
                self.state.stop.store(true, Ordering::Relaxed);
            }
            self.waker.wake();
        }
        true
    }

    /// What was asked for twice may come twice.
    fn is_new(&self, item: &Item) -> bool {
        item.seq >= self.request.from && !(self.has_end && item.is(flag::END))
    }

    fn set_connected(&self, is_connected: bool) {
        if self
            .state
            .is_connected
            .swap(is_connected, Ordering::Relaxed)
            != is_connected
        {
            self.waker.wake();
        }
    }

    fn has_stopped(&self) -> bool {
        self.state.stop.load(Ordering::Relaxed)
    }
}
