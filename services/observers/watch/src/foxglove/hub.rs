//! Between the threads that observe the run and the viewers.

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicUsize, Ordering},
};

use tokio::sync::watch;

use super::{
    channels::{self, Channel},
    viewer_queue::{EncodedMessage, ViewerQueue},
};

pub struct Hub {
    pub channels: Vec<Channel>,
    pub of_run: watch::Sender<Vec<usize>>,
    /// The newest sentence about a topic that is not shown.
    pub notice: watch::Sender<String>,
    wanted: Vec<AtomicUsize>,
    viewers: Mutex<Vec<Arc<ViewerQueue>>>,
}

/// A viewer in the hub. Dropped, it is removed with its subscriptions.
pub struct HubMember {
    hub: Arc<Hub>,
    pub queue: Arc<ViewerQueue>,
}

impl Default for Hub {
    fn default() -> Self {
        let channels = channels::all();
        Self {
            wanted: channels.iter().map(|_| AtomicUsize::new(0)).collect(),
            channels,
            of_run: watch::Sender::default(),
            notice: watch::Sender::default(),
            viewers: Mutex::default(),
        }
    }
}

impl Hub {
    fn viewers(&self) -> MutexGuard<'_, Vec<Arc<ViewerQueue>>> {
        self.viewers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn position(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|it| it.name == name)
    }

    pub fn is_wanted(&self, name: &str) -> bool {
        let has = |channel: usize| self.wanted[channel].load(Ordering::Relaxed) > 0;
        self.position(name).is_some_and(has)
    }

    pub fn wants_topic(&self, topic: &str) -> bool {
        let mut of_topic = self.channels.iter().filter(|it| it.topic == Some(topic));
        of_topic.any(|channel| self.is_wanted(channel.name))
    }

    pub fn publish(&self, name: &str, stamp_ns: i64, data: Vec<u8>) {
        let Some(channel) = self.position(name) else {
            return;
        };
        let message = EncodedMessage {
            channel,
            is_bulky: self.channels[channel].is_bulky,
            stamp_ns,
            data: data.into(),
        };
        self.viewers().iter().for_each(|it| it.put(&message));
    }

    pub fn join(self: &Arc<Self>) -> HubMember {
        let queue = Arc::new(ViewerQueue::default());
        self.viewers().push(Arc::clone(&queue));
        HubMember {
            hub: Arc::clone(self),
            queue,
        }
    }
}

impl HubMember {
    /// Subscribes to a channel; false if the number is unknown.
    pub fn subscribe(&self, channel: usize, subscription: u32) -> bool {
        let Some(wanted) = self.hub.wanted.get(channel) else {
            return false;
        };
        if self.queue.subscribe(channel, subscription) {
            wanted.fetch_add(1, Ordering::Relaxed);
        }
        true
    }

    /// Ends a subscription; one that there is not has ended already.
    pub fn unsubscribe(&self, subscription: u32) {
        if let Some(channel) = self.queue.unsubscribe(subscription) {
            self.hub.wanted[channel].fetch_sub(1, Ordering::Relaxed);
        }
    }
}

impl Drop for HubMember {
    fn drop(&mut self) {
        for channel in self.queue.subscribed() {
            self.hub.wanted[channel].fetch_sub(1, Ordering::Relaxed);
        }
        let is_other = |other: &Arc<ViewerQueue>| !Arc::ptr_eq(other, &self.queue);
        self.hub.viewers().retain(is_other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_is_wanted_as_long_as_a_viewer_has_subscribed_to_one_of_its_channels() {
        let hub = Arc::new(Hub::default());
        let id = |name| hub.position(name).unwrap_or(usize::MAX);
        let (first, second) = (hub.join(), hub.join());
        assert!(first.subscribe(id("/tf"), 1) && second.subscribe(id("/points"), 1));
        assert!(first.subscribe(id("/tf"), 2));
        assert!(!first.subscribe(hub.channels.len(), 3));
        let wanted = || ["pose", "masked", "scan"].map(|topic| hub.wants_topic(topic));
        assert_eq!(wanted(), [true, true, false]);
        first.unsubscribe(2);
        assert_eq!(wanted(), [false, true, false]);
        drop(second);
        assert_eq!(wanted(), [false; 3]);
        assert_eq!(hub.viewers().len(), 1);
    }
}
