//! The permits of connections.

use std::{
    net::IpAddr,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use tokio::{sync::Notify, task::AbortHandle};

use super::Peer;

/// A bounded number of permits.
pub struct Permits {
    limit: usize,
    taken: Mutex<Taken>,
    /// Notified when a permit is free again.
    freed: Notify,
}

#[derive(Default)]
struct Taken {
    /// The oldest first.
    connections: Vec<Connection>,
    next: u64,
}

struct Connection {
    number: u64,
    address: IpAddr,
    peer: Peer,
    task: Option<AbortHandle>,
}

/// A permit that is taken. Dropped, it is free again.
pub struct Permit {
    permits: Arc<Permits>,
    number: u64,
}

impl Permits {
    /// So many permits, all of them free.
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            taken: Mutex::default(),
            freed: Notify::new(),
        }
    }

    fn taken(&self) -> MutexGuard<'_, Taken> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn wait_until(&self, holds: impl Fn(&Taken) -> bool) {
        loop {
            // What is freed from here on wakes it.
            let freed = self.freed.notified();
            if holds(&self.taken()) {
                return;
            }
            freed.await;
        }
    }

    /// Waits until a permit is free, or a connection has one that can give way.
    pub async fn wait_for_room(&self) {
        let has_room = |taken: &Taken| {
            let mut connections = taken.connections.iter();
            taken.connections.len() < self.limit || connections.any(Connection::can_give_way)
        };
        self.wait_until(has_room).await;
    }

    /// Waits until no permit is taken.
    pub async fn wait_for_end(&self) {
        self.wait_until(|taken| taken.connections.is_empty()).await;
    }

    /// Takes a permit, which another connection may have to leave for it.
    pub fn take(self: &Arc<Self>, address: IpAddr) -> (Permit, Peer) {
        let (mut taken, peer) = (self.taken(), Peer::default());
        if taken.connections.len() >= self.limit
            && let Some(at) = taken.first_to_go()
        {
            let connection = taken.connections.remove(at);
            if let Some(task) = connection.task {
                task.abort();
            }
        }
        let number = taken.next;
        taken.next += 1;
        taken.connections.push(Connection {
            number,
            address,
            peer: peer.clone(),
            task: None,
        });
        let permits = Arc::clone(self);
        (Permit { permits, number }, peer)
    }

    /// Returns the addresses of the connections, the oldest first.
    #[cfg(test)]
    pub fn addresses(&self) -> Vec<IpAddr> {
        let taken = self.taken();
        taken.connections.iter().map(|it| it.address).collect()
    }

    /// Says which task ends when the connection has to give way.
    pub fn let_end(&self, number: u64, task: AbortHandle) {
        let mut taken = self.taken();
        let mut connections = taken.connections.iter_mut();
        if let Some(connection) = connections.find(|it| it.number == number) {
            connection.task = Some(task);
        }
    }
}

impl Taken {
    /// Returns the connection that gives way first: of the address that has most of those which
    /// can, the oldest. So one address cannot take the permits of all others.
    fn first_to_go(&self) -> Option<usize> {
        let can_give_way = || {
            let connections = self.connections.iter().enumerate();
            connections.filter(|(_, it)| it.can_give_way())
        };
        let of_same = |address: IpAddr| can_give_way().filter(move |(_, it)| it.address == address);
        // Of equal numbers the last one counts, hence the oldest last.
        let permits = can_give_way().rev();
        permits
            .max_by_key(|(_, it)| of_same(it.address).count())
            .map(|(at, _)| at)
    }
}

impl Connection {
    fn can_give_way(&self) -> bool {
        !self.peer.keeps_place()
    }
}

impl Permit {
    /// Returns the number of the connection that has it.
    pub fn number(&self) -> u64 {
        self.number
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        let mut taken = self.permits.taken();
        taken.connections.retain(|it| it.number != self.number);
        drop(taken);
        self.permits.freed.notify_waiters();
    }
}
