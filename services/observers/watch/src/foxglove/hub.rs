//! Between the threads that observe the run and the viewers.

use std::{collections::VecDeque, sync::Arc};

use axum::body::Bytes;
use tokio::sync::{
    broadcast::{self, error::TryRecvError},
    watch,
};

use super::channels::{self, Channel};

/// The most messages of a channel that wait for a viewer: a minute of poses. Of pictures only the
/// newest waits.
const DEPTH: usize = 256;

pub struct Hub {
    pub channels: Vec<Channel>,
    pub of_run: watch::Sender<Vec<usize>>,
    /// The newest sentence about a topic that is not shown.
    pub notice: watch::Sender<String>,
    messages: Vec<broadcast::Sender<EncodedMessage>>,
    /// Changes with each message.
    published: watch::Sender<()>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct EncodedMessage {
    /// Time of the scan on the sensor's clock, ns.
    pub stamp_ns: i64,
    pub data: Bytes,
}

/// The subscriptions of a viewer.
pub struct Subscriptions {
    hub: Arc<Hub>,
    published: watch::Receiver<()>,
    /// The one that was read last is the last.
    all: VecDeque<Subscription>,
    /// Messages that this viewer was too slow for.
    pub skipped: u64,
}

struct Subscription {
    channel: usize,
    /// The viewer's number.
    id: u32,
    messages: broadcast::Receiver<EncodedMessage>,
}

impl Default for Hub {
    fn default() -> Self {
        let channels = channels::all();
        let messages = channels.iter().map(|channel| {
            let depth = if channel.is_bulky { 1 } else { DEPTH };
            broadcast::Sender::new(depth)
        });
        Self {
            messages: messages.collect(),
            channels,
            of_run: watch::Sender::default(),
            notice: watch::Sender::default(),
            published: watch::Sender::default(),
        }
    }
}

impl Hub {
    fn position(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|it| it.name == name)
    }

    pub fn is_wanted(&self, name: &str) -> bool {
        let has = |channel: usize| self.messages[channel].receiver_count() > 0;
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
        let data = data.into();
        // Without a viewer nobody receives it.
        let _ = self.messages[channel].send(EncodedMessage { stamp_ns, data });
        self.published.send_replace(());
    }
}

impl Subscriptions {
    pub fn of(hub: Arc<Hub>) -> Self {
        Self {
            published: hub.published.subscribe(),
            hub,
            all: VecDeque::new(),
            skipped: 0,
        }
    }

    /// Subscribes to a channel, or changes its number; false if there is no such channel.
    pub fn add(&mut self, channel: usize, id: u32) -> bool {
        let Some(messages) = self.hub.messages.get(channel) else {
            return false;
        };
        let messages = messages.subscribe();
        self.all.retain(|it| it.channel != channel);
        self.all.push_back(Subscription {
            channel,
            id,
            messages,
        });
        true
    }

    /// Ends a subscription; one that there is not has ended already.
    pub fn remove(&mut self, id: u32) {
        self.all.retain(|it| it.id != id);
    }

    /// Waits for the next message, and returns it with the viewer's number of its subscription.
    pub async fn next(&mut self) -> (u32, EncodedMessage) {
        loop {
            if let Some(next) = self.take() {
                return next;
            }
            // The hub is not dropped before its viewers.
            let _ = self.published.changed().await;
        }
    }

    /// Takes a message that waits, of each channel in turn.
    fn take(&mut self) -> Option<(u32, EncodedMessage)> {
        for _ in 0..self.all.len() {
            self.all.rotate_left(1);
            let subscription = self.all.back_mut()?;
            loop {
                match subscription.messages.try_recv() {
                    Ok(message) => return Some((subscription.id, message)),
                    Err(TryRecvError::Lagged(skipped)) => self.skipped += skipped,
                    Err(_) => break,
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::iter;

    use super::*;

    fn id(hub: &Hub, name: &str) -> usize {
        hub.position(name).unwrap_or(usize::MAX)
    }

    #[test]
    fn a_topic_is_wanted_as_long_as_a_viewer_has_subscribed_to_one_of_its_channels() {
        let hub = Arc::new(Hub::default());
        let [mut first, mut second] = [(); 2].map(|()| Subscriptions::of(Arc::clone(&hub)));
        assert!(first.add(id(&hub, "/tf"), 1) && second.add(id(&hub, "/points"), 1));
        assert!(first.add(id(&hub, "/tf"), 2));
        assert!(!first.add(hub.channels.len(), 3));
        let wanted = || ["pose", "masked", "scan"].map(|topic| hub.wants_topic(topic));
        assert_eq!(wanted(), [true, true, false]);
        first.remove(1);
        assert_eq!(wanted(), [true, true, false]);
        first.remove(2);
        assert_eq!(wanted(), [false, true, false]);
        drop(second);
        assert_eq!(wanted(), [false; 3]);
    }

    #[test]
    fn of_pictures_the_newest_waits_and_of_all_else_the_last_ones() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Subscriptions::of(Arc::clone(&hub));
        assert!(viewer.add(id(&hub, "/scan"), 70) && viewer.add(id(&hub, "/pose"), 71));
        for bytes in 1..=5 {
            for name in ["/scan", "/pose", "/tf"] {
                hub.publish(name, 0, vec![0; bytes]);
            }
        }
        let taken = iter::from_fn(|| viewer.take());
        let taken: Vec<_> = taken.map(|(id, it)| (id, it.data.len())).collect();
        assert_eq!(
            taken,
            [(70, 5), (71, 1), (71, 2), (71, 3), (71, 4), (71, 5)]
        );
        assert_eq!(viewer.skipped, 4);
        (0..1000).for_each(|stamp_ns| hub.publish("/pose", stamp_ns, Vec::new()));
        let waiting = iter::from_fn(|| viewer.take()).count() as u64;
        assert_eq!(waiting, DEPTH as u64);
        assert_eq!(viewer.skipped, 4 + 1000 - waiting);
        hub.publish("/pose", 0, Vec::new());
        viewer.remove(71);
        assert_eq!(viewer.take(), None);
    }
}
