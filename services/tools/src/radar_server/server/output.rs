//! The receivers of a playback: clients by TCP, or a group by UDP.

use std::{
    io,
    net::{Ipv4Addr, SocketAddrV4, TcpListener},
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::Configuration;

use super::{Clients, Faults, Group};

/// The longest time between two checks for a request to stop.
const SLICE: Duration = Duration::from_millis(50);
/// Time between two polls for a client.
const POLL: Duration = Duration::from_millis(5);
/// Time between two descriptions of a radar that sends no powers yet.
const DESCRIBE_PERIOD: Duration = Duration::from_millis(100);

/// The receivers that a recording is played to.
#[derive(Debug)]
pub enum Audience {
    /// Clients by TCP, from the first request for azimuths on.
    Clients(TcpListener),
    /// The receivers of the datagrams, if there are any.
    Group {
        /// The group, or the address of one receiver.
        to: SocketAddrV4,
        /// The address of this machine for sending them; if unspecified, the system chooses.
        interface: Ipv4Addr,
        /// Time before the first scan, for which only the radar's description is sent.
        wait: Duration,
    },
}

/// The open sockets of a playback.
pub(crate) enum Output {
    Clients(Clients),
    Group { group: Group, wait: Duration },
}

impl Output {
    /// Begins to accept clients, or opens the socket of a group.
    pub fn open(audience: Audience, radar: &Configuration, faults: Faults) -> io::Result<Self> {
        Ok(match audience {
            Audience::Clients(listener) => Self::Clients(Clients::accept(listener, radar)?),
            Audience::Group {
                to,
                interface,
                wait,
            } => Self::Group {
                group: Group::open(to, interface, faults)?,
                wait,
            },
        })
    }

    /// Describes the radar to a group for the time that was asked for; false on a request to stop.
    pub fn describe(&mut self, radar: &Configuration, stop: &dyn Fn() -> bool) -> bool {
        let Self::Group { group, wait } = self else {
            return true;
        };
        let end = Instant::now() + *wait;
        while Instant::now() < end {
            group.describe(radar);
            if stop() {
                return false;
            }
            sleep(DESCRIBE_PERIOD);
        }
        true
    }

    /// Waits until a client has asked for azimuths; false on a request to stop.
    pub fn await_client(&self, stop: &dyn Fn() -> bool) -> bool {
        let Self::Clients(clients) = self else {
            return true;
        };
        while !clients.any_started() {
            if stop() {
                return false;
            }
            sleep(POLL);
        }
        true
    }

    /// Sends bytes as they are: a part of a stream, or one datagram.
    pub fn send(&mut self, bytes: &[u8]) {
        match self {
            Self::Clients(clients) => clients.send(bytes),
            Self::Group { group, .. } => group.pass(bytes),
        }
    }

    /// Ends the connections when the clients have read all.
    pub fn close(&self) {
        if let Self::Clients(clients) = self {
            clients.close();
        }
    }
}

/// Sleeps until a time; false on a request to stop. Before a short sleep `stop` is not called: it
/// would take longer than the time between two azimuths.
pub(crate) fn sleep_until(due: Instant, stop: &dyn Fn() -> bool) -> bool {
    loop {
        let left = due.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return true;
        }
        if left > SLICE && stop() {
            return false;
        }
        sleep(left.min(SLICE));
    }
}
