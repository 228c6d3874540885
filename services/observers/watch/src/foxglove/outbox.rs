//! What waits for a viewer.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Mutex, MutexGuard, PoisonError},
};

use axum::body::Bytes;
use tokio::sync::Notify;

/// The most bytes that wait: five of the largest scans, or all that a minute has of poses.
const LIMIT_BYTES: usize = 8 << 20;
/// Bytes that a waiting message takes beside its content.
const OVERHEAD_BYTES: usize = 64;

/// The messages that wait for one viewer, and what it has subscribed to.
#[derive(Default)]
pub struct Outbox {
    waiting: Mutex<Waiting>,
    news: Notify,
}

/// An encoded message, which all viewers share.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoded {
    /// The channel's number.
    pub channel: usize,
    /// Whether only the newest of the channel waits.
    pub is_bulky: bool,
    /// Time of the scan on the sensor's clock, ns.
    pub stamp_ns: i64,
    /// The message.
    pub data: Bytes,
}

#[derive(Default)]
struct Waiting {
    /// The viewer's number of each subscription, by channel.
    subscriptions: BTreeMap<usize, u32>,
    messages: VecDeque<Encoded>,
    bytes: usize,
    skipped: u64,
}

impl Encoded {
    fn bytes(&self) -> usize {
        self.data.len() + OVERHEAD_BYTES
    }
}

impl Outbox {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Subscribes to a channel, and returns whether it is new. The newer number of a channel replaces the older one.
    pub fn subscribe(&self, channel: usize, subscription: u32) -> bool {
        let mut waiting = self.waiting();
        waiting
            .subscriptions
            .insert(channel, subscription)
            .is_none()
    }

    /// Ends a subscription, and returns its channel.
    pub fn unsubscribe(&self, subscription: u32) -> Option<usize> {
        let mut waiting = self.waiting();
        let mut all = waiting.subscriptions.iter();
        let channel = *all.find(|(_, number)| **number == subscription)?.0;
        waiting.subscriptions.remove(&channel);
        waiting.remove(channel);
        Some(channel)
    }

    /// Returns the channels that are subscribed to.
    pub fn subscribed(&self) -> Vec<usize> {
        self.waiting().subscriptions.keys().copied().collect()
    }

    /// Puts a message where the viewer finds it, if it has subscribed to the channel. What does not fit any more is skipped, the oldest
    /// first.
    pub fn put(&self, message: &Encoded) {
        let mut waiting = self.waiting();
        if !waiting.subscriptions.contains_key(&message.channel) {
            return;
        }
        if message.is_bulky {
            waiting.skipped += waiting.remove(message.channel);
        }
        waiting.bytes += message.bytes();
        waiting.messages.push_back(message.clone());
        while waiting.bytes > LIMIT_BYTES && waiting.messages.len() > 1 {
            waiting.take();
            waiting.skipped += 1;
        }
        drop(waiting);
        self.news.notify_one();
    }

    /// Waits for the next message, and returns it with the viewer's number of its subscription.
    pub async fn next(&self) -> (u32, Encoded) {
        loop {
            if let Some(next) = self.waiting().next() {
                return next;
            }
            self.news.notified().await;
        }
    }

    /// Returns the number of messages that were skipped since the last call.
    pub fn skipped(&self) -> u64 {
        std::mem::take(&mut self.waiting().skipped)
    }
}

impl Waiting {
    fn take(&mut self) -> Option<Encoded> {
        let message = self.messages.pop_front()?;
        self.bytes -= message.bytes();
        Some(message)
    }

    fn next(&mut self) -> Option<(u32, Encoded)> {
        let message = self.take()?;
        let subscription = *self.subscriptions.get(&message.channel)?;
        Some((subscription, message))
    }

    /// Removes the messages of a channel, and returns their number.
    fn remove(&mut self, channel: usize) -> u64 {
        let before = self.messages.len();
        self.messages.retain(|message| message.channel != channel);
        self.bytes = self.messages.iter().map(Encoded::bytes).sum();
        (before - self.messages.len()) as u64
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn message(channel: usize, is_bulky: bool, bytes: usize) -> Encoded {
        Encoded {
            channel,
            is_bulky,
            stamp_ns: 0,
            data: vec![0; bytes].into(),
        }
    }

    fn next(outbox: &Outbox) -> Option<(u32, Encoded)> {
        outbox.waiting().next()
    }

    #[test]
    fn a_viewer_receives_what_it_has_subscribed_to_and_no_more_when_it_has_unsubscribed() {
        let outbox = Outbox::default();
        assert!(outbox.subscribe(3, 70));
        outbox.put(&message(2, false, 10));
        outbox.put(&message(3, false, 20));
        assert_eq!(next(&outbox), Some((70, message(3, false, 20))));
        outbox.put(&message(3, false, 30));
        assert_eq!(outbox.unsubscribe(71), None);
        assert_eq!(outbox.unsubscribe(70), Some(3));
        assert_eq!(next(&outbox), None);
        assert_eq!(outbox.waiting().bytes, 0);
    }

    #[test]
    fn of_pictures_the_newest_waits_and_of_all_else_what_fits() {
        let outbox = Outbox::default();
        outbox.subscribe(0, 1);
        outbox.subscribe(1, 2);
        for bytes in 1..=5 {
            outbox.put(&message(0, true, bytes));
            outbox.put(&message(1, false, bytes));
        }
        assert_eq!(outbox.skipped(), 4);
        let order: Vec<_> = std::iter::from_fn(|| next(&outbox)).collect();
        let lengths: Vec<_> = order.iter().map(|(id, m)| (*id, m.data.len())).collect();
        assert_eq!(lengths, [(2, 1), (2, 2), (2, 3), (2, 4), (1, 5), (2, 5)]);
        for _ in 0..1000 {
            outbox.put(&message(1, false, 1 << 20));
            assert!(outbox.waiting().bytes <= LIMIT_BYTES);
        }
        assert_eq!(outbox.skipped(), 993);
        // A message that is larger than all the room waits alone.
        outbox.put(&message(1, false, 2 * LIMIT_BYTES));
        assert_eq!(outbox.waiting().messages.len(), 1);
    }
}
