//! The sending end of a topic: answers a request with the messages from the requested one on.

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use gyre_client::RunError;
use zenoh::{
    Session, Wait,
    query::{Query, Queryable},
};

use crate::{
    error::failed,
    replay_buffer::{Next, Place, ReplayBuffer},
    waker::Waker,
};

/// Time after which the receiver asks again, so that a sender forgets one that has gone.
pub(crate) const REQUEST_LIFETIME: Duration = Duration::from_secs(20);
/// Time without a message after which an empty message shows the receiver that this end is still
/// there.
const KEEP_ALIVE: Duration = Duration::from_secs(1);
pub(crate) const LAST_ANSWERS: Duration = Duration::from_millis(300);
const POLL_INTERVAL: Duration = Duration::from_millis(200);
/// The most requests of a topic that are answered at once. A receiver has one of each topic.
const MAX_REQUESTS: usize = 64;

/// The answer that means that no message follows.
pub(crate) const ENDED: &str = "ended";
/// The parameter with the first message that is wanted.
pub(crate) const FROM: &str = "from";
/// The parameter with the generation of the newest message at the receiver, if numbers may be given
/// again.
pub(crate) const GENERATION: &str = "generation";
/// The parameter with the identity of a receiver.
pub(crate) const RECEIVER: &str = "receiver";
/// The parameter of a receiver that has everything, or wants no more.
pub(crate) const DONE: &str = "done";

pub(crate) struct Server {
    session: Session,
    prefix: String,
    waker: Option<Waker>,
    stop: Arc<AtomicBool>,
    queryables: Vec<Queryable<()>>,
}

pub(crate) struct Offer {
    buffer: Arc<dyn ReplayBuffer>,
    key: String,
    /// The highest number of the requests that have been answered: all before it has arrived.
    answered: AtomicU64,
    /// The newest request of each receiver, which replaces those before.
    receivers: Mutex<BTreeMap<String, ReceiverState>>,
    messages: AtomicU64,
    bytes: AtomicU64,
    waker: Option<Waker>,
    stop: Arc<AtomicBool>,
}

struct ReceiverState {
    request: u64,
    is_done: bool,
}

impl Server {
    pub fn new(session: &Session, prefix: &str, waker: Option<Waker>) -> Self {
        Self {
            session: session.clone(),
            prefix: prefix.to_owned(),
            waker,
            stop: Arc::default(),
            queryables: Vec::new(),
        }
    }

    pub fn offer(
        &mut self,
        topic: &str,
        buffer: Arc<dyn ReplayBuffer>,
    ) -> Result<Arc<Offer>, RunError> {
        let offer = Arc::new(Offer {
            buffer,
            key: format!("{}/{topic}", self.prefix),
            answered: AtomicU64::new(0),
            receivers: Mutex::default(),
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            waker: self.waker.clone(),
            stop: self.stop.clone(),
        });
        let answering = offer.clone();
        let queryable = self
            .session
            .declare_queryable(&offer.key)
            .callback(move |query| answering.clone().accept(query))
            .wait()
            .map_err(|e| failed(&format!("offer {topic}"), &e))?;
        self.queryables.push(queryable);
        Ok(offer)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Offer {
    /// Returns the number before which all has arrived, as far as the receiver can know that it is
    /// known here.
    pub fn answered(&self) -> u64 {
        self.answered.load(Ordering::Relaxed)
    }

    pub fn sent(&self) -> (u64, u64) {
        let read = |number: &AtomicU64| number.load(Ordering::Relaxed);
        (read(&self.messages), read(&self.bytes))
    }

    pub fn has_receivers(&self) -> bool {
        !self.receivers().is_empty()
    }

    /// Returns whether all receivers have confirmed the end: arrival is not guaranteed.
    pub fn is_done(&self) -> bool {
        self.receivers().values().all(|receiver| receiver.is_done)
    }

    fn receivers(&self) -> MutexGuard<'_, BTreeMap<String, ReceiverState>> {
        let receivers = self.receivers.lock();
        receivers.unwrap_or_else(PoisonError::into_inner)
    }

    /// Answers a request in a thread of its own, since sending waits while the network is slow.
    fn accept(self: Arc<Self>, query: Query) {
        let parameters = query.parameters();
        let receiver = parameters.get(RECEIVER).unwrap_or_default().to_owned();
        if parameters.get(DONE).is_some() {
            self.replace(&receiver, true);
            let _ = query.reply_err(ENDED).wait();
            return;
        }
        let Some(from) = parameters.get(FROM).and_then(|from| from.parse().ok()) else {
            return;
        };
        // Each thread that answers has a reference.
        if Arc::strong_count(&self) > MAX_REQUESTS {
            return;
        }
        let place = Place {
            seq: from,
            generation: parameters.get(GENERATION).and_then(|it| it.parse().ok()),
        };
        let request = self.replace(&receiver, false);
        // A receiver that is not answered asks again.
        let _ = thread::Builder::new().spawn(move || {
            if let Err(error) = self.answer(&query, place, &receiver, request) {
                tracing::debug!("{}: {error}", self.key);
            }
        });
    }

    fn answer(
        &self,
        query: &Query,
        mut place: Place,
        receiver: &str,
        request: u64,
    ) -> Result<(), RunError> {
        // The receiver learns at once that this end is there.
        self.reply(query, &[])?;
        self.answered.fetch_max(place.seq, Ordering::Relaxed);
        if let Some(waker) = &self.waker {
            waker.wake();
        }
        let mut last_reply = Instant::now();
        let until = last_reply + REQUEST_LIFETIME;
        while Instant::now() < until && self.is_wanted(receiver, request) {
            match self.buffer.next(place, POLL_INTERVAL)? {
                Next::Message(message) => {
                    self.reply(query, &message.bytes)?;
                    self.messages.fetch_add(1, Ordering::Relaxed);
                    let bytes = message.bytes.len() as u64;
                    self.bytes.fetch_add(bytes, Ordering::Relaxed);
                    place.pass(&message);
                    last_reply = Instant::now();
                }
                Next::Nothing if last_reply.elapsed() > KEEP_ALIVE => {
                    self.reply(query, &[])?;
                    last_reply = Instant::now();
                }
                Next::Nothing => {}
                Next::Ended => {
                    let replied = query.reply_err(ENDED).wait();
                    return replied.map_err(|e| failed("send", &e));
                }
            }
        }
        Ok(())
    }

    fn reply(&self, query: &Query, bytes: &[u8]) -> Result<(), RunError> {
        let reply = query.reply(&self.key, bytes).express(true);
        reply.wait().map_err(|e| failed("send", &e))
    }

    /// Notes a request of a receiver, which replaces those before; returns its number.
    fn replace(&self, receiver: &str, is_done: bool) -> u64 {
        let mut receivers = self.receivers();
        let before = receivers.get(receiver);
        let before = before.map_or(0, |receiver| receiver.request);
        let state = ReceiverState {
            request: before + 1,
            is_done,
        };
        receivers.insert(receiver.to_owned(), state);
        before + 1
    }

    fn is_wanted(&self, receiver: &str, request: u64) -> bool {
        let newest = self.receivers().get(receiver).map(|state| state.request);
        !self.stop.load(Ordering::Relaxed) && newest == Some(request)
    }
}
