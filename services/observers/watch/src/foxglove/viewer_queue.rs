//! The queue of messages to a viewer.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Mutex, MutexGuard, PoisonError},
};

use axum::body::Bytes;
use tokio::sync::Notify;

/// The most bytes that wait: five of the largest scans, or all that a minute has of poses.
const LIMIT_BYTES: usize = 8 << 20;
/// Bytes that a queue message takes beside its content.
const OVERHEAD_BYTES: usize = 64;

#[derive(Default)]
pub struct ViewerQueue {
    queue: Mutex<Queue>,
    added: Notify,
}

#[derive(Clone, Debug, PartialEq)]
pub struct EncodedMessage {
    pub channel: usize,
    /// True if only the newest of the channel waits.
    pub is_bulky: bool,
    /// Time of the scan on the sensor's clock, ns.
    pub stamp_ns: i64,
    pub data: Bytes,
}

#[derive(Default)]
struct Queue {
    subscriptions: BTreeMap<usize, u32>,
    messages: VecDeque<EncodedMessage>,
    bytes: usize,
    skipped: u64,
}

impl EncodedMessage {
    fn bytes(&self) -> usize {
        self.data.len() + OVERHEAD_BYTES
    }
}

impl ViewerQueue {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Subscribes to a channel, or changes its number; returns whether the channel is new.
    pub fn subscribe(&self, channel: usize, subscription: u32) -> bool {
        let mut queue = self.queue();
        queue.subscriptions.insert(channel, subscription).is_none()
    }

    pub fn unsubscribe(&self, subscription: u32) -> Option<usize> {
        let mut queue = self.queue();
        let mut all = queue.subscriptions.iter();
        let channel = *all.find(|(_, number)| **number == subscription)?.0;
        queue.subscriptions.remove(&channel);
        queue.remove(channel);
        Some(channel)
    }

    pub fn subscribed(&self) -> Vec<usize> {
        self.queue().subscriptions.keys().copied().collect()
    }

    /// Adds a message of a subscribed channel, and skips the oldest that do not fit any more.
    pub fn put(&self, message: &EncodedMessage) {
        let mut queue = self.queue();
        if !queue.subscriptions.contains_key(&message.channel) {
            return;
        }
        if message.is_bulky {
            queue.skipped += queue.remove(message.channel);
        }
        queue.bytes += message.bytes();
        queue.messages.push_back(message.clone());
        while queue.bytes > LIMIT_BYTES && queue.messages.len() > 1 {
            queue.take();
            queue.skipped += 1;
        }
        drop(queue);
        self.added.notify_one();
    }

    /// Waits for the next message, and returns it with the viewer's number of its subscription.
    pub async fn next(&self) -> (u32, EncodedMessage) {
        loop {
            if let Some(next) = self.queue().next() {
                return next;
            }
            self.added.notified().await;
        }
    }

    /// Returns the number of messages that were skipped since the last call.
    pub fn skipped(&self) -> u64 {
        std::mem::take(&mut self.queue().skipped)
    }
}

impl Queue {
    fn take(&mut self) -> Option<EncodedMessage> {
        let message = self.messages.pop_front()?;
        self.bytes -= message.bytes();
        Some(message)
    }

    fn next(&mut self) -> Option<(u32, EncodedMessage)> {
        let message = self.take()?;
        let subscription = *self.subscriptions.get(&message.channel)?;
        Some((subscription, message))
    }

    fn remove(&mut self, channel: usize) -> u64 {
        let before = self.messages.len();
        self.messages.retain(|message| message.channel != channel);
        self.bytes = self.messages.iter().map(EncodedMessage::bytes).sum();
        (before - self.messages.len()) as u64
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn message(channel: usize, is_bulky: bool, bytes: usize) -> EncodedMessage {
        EncodedMessage {
            channel,
            is_bulky,
            stamp_ns: 0,
            data: vec![0; bytes].into(),
        }
    }

    fn next(queue: &ViewerQueue) -> Option<(u32, EncodedMessage)> {
        queue.queue().next()
    }

    #[test]
    fn a_viewer_receives_what_it_has_subscribed_to_and_no_more_when_it_has_unsubscribed() {
        let queue = ViewerQueue::default();
        assert!(queue.subscribe(3, 70));
        queue.put(&message(2, false, 10));
        queue.put(&message(3, false, 20));
        assert_eq!(next(&queue), Some((70, message(3, false, 20))));
        queue.put(&message(3, false, 30));
        assert_eq!(queue.unsubscribe(71), None);
        assert_eq!(queue.unsubscribe(70), Some(3));
        assert_eq!(next(&queue), None);
        assert_eq!(queue.queue().bytes, 0);
    }

    #[test]
    fn of_pictures_the_newest_waits_and_of_all_else_what_fits() {
        let queue = ViewerQueue::default();
        queue.subscribe(0, 1);
        queue.subscribe(1, 2);
        for bytes in 1..=5 {
            queue.put(&message(0, true, bytes));
            queue.put(&message(1, false, bytes));
        }
        assert_eq!(queue.skipped(), 4);
        let order: Vec<_> = std::iter::from_fn(|| next(&queue)).collect();
        let lengths: Vec<_> = order.iter().map(|(id, m)| (*id, m.data.len())).collect();
        assert_eq!(lengths, [(2, 1), (2, 2), (2, 3), (2, 4), (1, 5), (2, 5)]);
        for _ in 0..1000 {
            queue.put(&message(1, false, 1 << 20));
            assert!(queue.queue().bytes <= LIMIT_BYTES);
        }
        assert_eq!(queue.skipped(), 993);
        // A message that is larger than all the room waits alone.
        queue.put(&message(1, false, 2 * LIMIT_BYTES));
        assert_eq!(queue.queue().messages.len(), 1);
    }
}
