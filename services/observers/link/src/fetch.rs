//! The receiving end of a topic: requests all messages from one on, and again after each cut.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{Receiver, Sender, channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_client::{RecordedMessage, RunError};
use gyre_contract::{Item, flag};
use zenoh::{
    Session, Wait,
    qos::{CongestionControl, Priority},
    query::{ConsolidationMode, Reply, ReplyError},
};

use crate::{
    patience::Patience,
    serve::{DONE, ENDED, FROM, GENERATION, RECEIVER, REQUEST_LIFETIME},
    waker::Waker,
};

/// Time for the answer to the message that nothing more is wanted, and the number of attempts.
const DONE_TIMEOUT: Duration = Duration::from_secs(1);
const DONE_ATTEMPTS: usize = 3;
const POLL_INTERVAL: Duration = Duration::from_millis(200);
const PAUSES: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(1));

pub(crate) struct Fetcher {
    messages: Receiver<Vec<u8>>,
    state: Arc<State>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct State {
    stop: AtomicBool,
    /// True if the thread informs the sender, at the stop, that it needs no more messages.
    leaves: AtomicBool,
    again: AtomicBool,
    is_connected: AtomicBool,
    has_ended: AtomicBool,
    requested: AtomicU64,
    /// The first message of the newest request that was answered.
    answered: AtomicU64,
    /// The first message of those to come: see [`Fetcher::confirm`].
    confirmed: AtomicU64,
}

pub(crate) struct Request {
    pub key: String,
    pub from: u64,
    /// The generation of the messages before, 0 without any; `None` if no number is given twice.
    pub generation: Option<u32>,
    /// The identity of this receiver, the same after its restart.
    pub receiver: String,
    pub priority: Priority,
}

impl Request {
    fn selector(&self) -> String {
        let (key, from, receiver) = (&self.key, self.from, &self.receiver);
        let selector = format!("{key}?{FROM}={from};{RECEIVER}={receiver}");
        match self.generation {
            Some(generation) => format!("{selector};{GENERATION}={generation}"),
            None => selector,
        }
    }
}

impl Fetcher {
    pub fn start(session: &Session, request: Request, waker: Waker) -> Self {
        let (sender, messages) = channel();
        let state = Arc::new(State {
            requested: AtomicU64::new(request.from),
            confirmed: AtomicU64::new(request.from),
            ..State::default()
        });
        let requests = RequestLoop {
            session: session.clone(),
            request,
            sender,
            waker,
            has_end: false,
            patience: Patience::default(),
            state: state.clone(),
        };
        Self {
            messages,
            state,
            thread: Some(thread::spawn(move || requests.run())),
        }
    }

    pub fn next(&self) -> Option<Vec<u8>> {
        self.messages.try_recv().ok()
    }

    pub fn next_with_payload(
        &self,
        header_bytes: usize,
    ) -> Result<Option<RecordedMessage>, RunError> {
        let Some(mut header) = self.next() else {
            return Ok(None);
        };
        if header.len() < header_bytes {
            let reason = format!("a message of {} bytes is too short", header.len());
            return Err(RunError::Input(reason));
        }
        let payload = header.split_off(header_bytes);
        Ok(Some(RecordedMessage { header, payload }))
    }

    /// Confirms to the other side that all before message `next` has arrived, by a request from
    /// there. The end of a stream is requested again until it is confirmed.
    pub fn confirm(&self, next: u64) {
        self.state.confirmed.fetch_max(next, Ordering::Relaxed);
        if self.state.requested.load(Ordering::Relaxed) < next {
            self.state.again.store(true, Ordering::Relaxed);
        }
    }

    /// Returns whether the other side knows that all before message `next` has arrived.
    pub fn is_confirmed(&self, next: u64) -> bool {
        self.state.answered.load(Ordering::Relaxed) >= next
    }

    /// Begins to inform the other side, if it is reachable, that no more messages are needed.
    pub fn begin_to_leave(&self) {
        self.state.leaves.store(true, Ordering::Relaxed);
        self.state.stop.store(true, Ordering::Relaxed);
    }

    /// Informs the other side that no more messages are needed, and waits while it is reachable.
    pub fn leave(mut self) {
        self.begin_to_leave();
        if let Some(thread) = self.thread.take() {
            // The thread does not panic.
            let _ = thread.join();
        }
    }

    pub fn has_ended(&self) -> bool {
        self.state.has_ended.load(Ordering::Acquire)
    }

    pub fn is_connected(&self) -> bool {
        self.state.is_connected.load(Ordering::Relaxed)
    }
}

impl Drop for Fetcher {
    fn drop(&mut self) {
        self.state.stop.store(true, Ordering::Relaxed);
    }
}

struct RequestLoop {
    session: Session,
    request: Request,
    sender: Sender<Vec<u8>>,
    waker: Waker,
    has_end: bool,
    patience: Patience,
    state: Arc<State>,
}

impl RequestLoop {
    fn run(mut self) {
        let mut pause = PAUSES.0;
        while !self.has_stopped() {
            match self.request() {
                true => pause = PAUSES.0,
                false => {
                    self.set_connected(false);
                    thread::sleep(pause);
                    pause = (pause * 2).min(PAUSES.1);
                }
            }
        }
        let has_ended = self.state.has_ended.load(Ordering::Relaxed);
        if self.state.leaves.load(Ordering::Relaxed) && !has_ended {
            self.send_done();
        }
    }

    /// Informs the sender that no more messages are needed, so that it need not wait for this
    /// receiver.
    fn send_done(&self) {
        let Request { key, receiver, .. } = &self.request;
        for _ in 0..DONE_ATTEMPTS {
            let selector = format!("{key}?{DONE}=1;{RECEIVER}={receiver}");
            let asked = self.session.get(selector).timeout(DONE_TIMEOUT).wait();
            let answer = asked.ok().and_then(|answers| answers.recv().ok());
            if answer.is_some_and(|answer| answer.into_result().is_err_and(|it| is_end(&it))) {
                return;
            }
        }
    }

    /// Sends one request, and takes the answers until they end; returns whether there were any.
    fn request(&mut self) -> bool {
        // Before the number is read: messages confirmed after that are requested again.
        self.state.again.store(false, Ordering::Relaxed);
        let confirmed = self.state.confirmed.load(Ordering::Relaxed);
        self.request.from = self.request.from.max(confirmed);
        let Request { from, priority, .. } = &self.request;
        let asked = self
            .session
            .get(self.request.selector())
            .consolidation(ConsolidationMode::None)
            .congestion_control(CongestionControl::Block)
            .priority(*priority)
            // The sender lets a request end between two messages.
            .timeout(REQUEST_LIFETIME + self.patience.limit(true))
            .wait();
        let Ok(replies) = asked else {
            return false;
        };
        let mut was_answered = false;
        self.state.requested.store(*from, Ordering::Relaxed);
        let mut last_answer = Instant::now();
        loop {
            match replies.recv_timeout(POLL_INTERVAL) {
                Ok(Some(reply)) => {
                    was_answered |= self.take(reply, last_answer.elapsed());
                    last_answer = Instant::now();
                }
                Ok(None) if last_answer.elapsed() > self.patience.limit(was_answered) => {
                    self.patience.lost();
                    return false;
                }
                Ok(None) => {}
                Err(_) => return was_answered,
            }
            if self.has_stopped() || self.state.again.load(Ordering::Relaxed) {
                return true;
            }
        }
    }

    /// Takes an answer that took so long; false if it is an error.
    fn take(&mut self, reply: Reply, after: Duration) -> bool {
        let sample = match reply.into_result() {
            Ok(sample) => sample,
            Err(error) => {
                if is_end(&error) {
                    self.send_done();
                    self.state.has_ended.store(true, Ordering::Release);
                    self.state.stop.store(true, Ordering::Relaxed);
                    self.waker.wake();
                }
                return false;
            }
        };
        self.set_connected(true);
        let requested = self.state.requested.load(Ordering::Relaxed);
        self.state.answered.store(requested, Ordering::Relaxed);
        let bytes = sample.payload().to_bytes().into_owned();
        // The first answer is empty.
        let item = bytes.get(..size_of::<Item>());
        let item = item.map(bytemuck::pod_read_unaligned::<Item>);
        if let Some(item) = &item {
            self.go_back_to(item);
            self.patience.received(after);
        }
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

    /// Goes back to the first item that a later generation numbers again.
    fn go_back_to(&mut self, item: &Item) {
        let request = &mut self.request;
        if request
            .generation
            .is_some_and(|known| item.generation > known)
        {
            request.generation = Some(item.generation);
            request.from = item.numbered_from.min(request.from);
            self.has_end = false;
        }
    }

    /// Returns whether a message is new: a message that was requested twice may arrive twice.
    fn is_new(&self, item: &Item) -> bool {
        item.seq >= self.request.from && !(self.has_end && item.is(flag::END))
    }

    fn set_connected(&self, is_connected: bool) {
        let state = &self.state.is_connected;
        if state.swap(is_connected, Ordering::Relaxed) != is_connected {
            self.waker.wake();
        }
    }

    fn has_stopped(&self) -> bool {
        self.state.stop.load(Ordering::Relaxed)
    }
}

/// Returns whether an error means that no message follows; other errors come from the network
/// layer.
fn is_end(error: &ReplyError) -> bool {
    *error.payload().to_bytes() == *ENDED.as_bytes()
}
