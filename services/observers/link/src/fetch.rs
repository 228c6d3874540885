//! The end of a topic that receives: asks for all messages from one on, and again after each cut.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{Receiver, Sender, channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_messages::{Item, flag};
use zenoh::{
    Session, Wait,
    qos::{CongestionControl, Priority},
    query::{ConsolidationMode, Reply, ReplyError},
};

use crate::{
    serve::{ANSWERED_FOR, DONE, ENDED, FROM, RECEIVER},
    wake::Waker,
};

/// Time after which a request that nobody has ended is made again.
const GIVEN_UP: Duration = ANSWERED_FOR.saturating_add(Duration::from_secs(10));
/// The same for one that is not answered, and for one whose answers cease: a request can be lost at the moment of a cut, without an end. A scan
/// may take seconds on a slow network.
const UNANSWERED: Duration = Duration::from_secs(3);
const SILENT: Duration = Duration::from_secs(12);
/// Time for the answer to the word that nothing more is wanted, and how often it is said.
const DONE_ANSWER: Duration = Duration::from_secs(1);
const DONE_TIMES: usize = 3;
/// Time between two looks whether to go on.
const LOOK: Duration = Duration::from_millis(200);
/// Pauses between requests that nobody has answered, from the first to the longest.
const PAUSES: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(1));

/// A topic that is being received, by a thread.
pub(crate) struct Fetcher {
    messages: Receiver<Vec<u8>>,
    state: Arc<State>,
    thread: Option<JoinHandle<()>>,
}

struct State {
    stop: AtomicBool,
    /// Whether to say to the sender, at the stop, that nothing more is wanted.
    leaves: AtomicBool,
    again: AtomicBool,
    is_connected: AtomicBool,
    has_ended: AtomicBool,
    /// The first message of the newest request.
    asked: AtomicU64,
    /// The first message of the newest request that was answered.
    answered: AtomicU64,
    /// The first message of those to come: see [`Fetcher::confirm`].
    confirmed: AtomicU64,
}

/// What is asked for.
pub(crate) struct Request {
    /// The key of the topic.
    pub key: String,
    /// The first message.
    pub from: u64,
    /// What tells this receiver from others, and is the same when it begins again.
    pub receiver: String,
    /// Poses go before scans.
    pub priority: Priority,
}

impl Fetcher {
    /// Receives the messages of a topic, and wakes `waker` for each.
    pub fn start(session: &Session, request: Request, waker: Waker) -> Self {
        let (sender, messages) = channel();
        let state = Arc::new(State {
            stop: AtomicBool::new(false),
            leaves: AtomicBool::new(false),
            again: AtomicBool::new(false),
            is_connected: AtomicBool::new(false),
            has_ended: AtomicBool::new(false),
            asked: AtomicU64::new(request.from),
            answered: AtomicU64::new(0),
            confirmed: AtomicU64::new(request.from),
        });
        let asking = Asking {
            session: session.clone(),
            request,
            sender,
            waker,
            has_end: false,
            state: state.clone(),
        };
        Self {
            messages,
            state,
            thread: Some(thread::spawn(move || asking.run())),
        }
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

    /// Returns whether the other side knows that all before message `next` has arrived.
    pub fn is_confirmed(&self, next: u64) -> bool {
        self.state.answered.load(Ordering::Relaxed) >= next
    }

    /// Has the other side told that nothing more is wanted, if it can be reached.
    pub fn begin_to_leave(&self) {
        self.state.leaves.store(true, Ordering::Relaxed);
        self.state.stop.store(true, Ordering::Relaxed);
    }

    /// Tells the other side that nothing more is wanted, and waits until it knows or cannot be reached.
    pub fn leave(mut self) {
        self.begin_to_leave();
        if let Some(thread) = self.thread.take() {
            // It does not panic.
            let _ = thread.join();
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
        let has_said = self.state.has_ended.load(Ordering::Relaxed);
        if self.state.leaves.load(Ordering::Relaxed) && !has_said {
            self.say_done();
        }
    }

    /// Tells the sender that nothing more is wanted, so that it need not wait for this receiver.
    fn say_done(&self) {
        let Request { key, receiver, .. } = &self.request;
        for _ in 0..DONE_TIMES {
            let selector = format!("{key}?{DONE}=1;{RECEIVER}={receiver}");
            let asked = self.session.get(selector).timeout(DONE_ANSWER).wait();
            let answer = asked.ok().and_then(|answers| answers.recv().ok());
            if answer.is_some_and(|answer| answer.into_result().is_err_and(|it| is_end(&it))) {
                return;
            }
        }
    }

    /// Asks once, and takes the answers until they end; returns whether there were any.
    fn ask(&mut self) -> bool {
        // Before the number is read: what is confirmed after that is asked for again.
        self.state.again.store(false, Ordering::Relaxed);
        let confirmed = self.state.confirmed.load(Ordering::Relaxed);
        self.request.from = self.request.from.max(confirmed);
        let Request {
            key,
            from,
            receiver,
            priority,
        } = &self.request;
        let selector = format!("{key}?{FROM}={from};{RECEIVER}={receiver}");
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
                if is_end(&error) {
                    self.say_done();
                    self.state.has_ended.store(true, Ordering::Release);
                    self.state.stop.store(true, Ordering::Relaxed);
                    self.waker.wake();
                }
                return false;
            }
        };
        self.set_connected(true);
        let asked = self.state.asked.load(Ordering::Relaxed);
        self.state.answered.store(asked, Ordering::Relaxed);
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

/// Returns whether an answer says that no message follows; others are of the network layer.
fn is_end(error: &ReplyError) -> bool {
    *error.payload().to_bytes() == *ENDED.as_bytes()
}
