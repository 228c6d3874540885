//! The datagrams of a radar that is played: sent to a group, whoever receives them.

use std::{
    io,
    net::{Ipv4Addr, SocketAddrV4, UdpSocket},
};

use gyre_colossus::{
    Azimuth, Configuration,
    asterix::{write_azimuth, write_description},
};

use super::Faults;

/// The socket and the destination of datagrams.
pub struct Group {
    socket: UdpSocket,
    to: SocketAddrV4,
    faults: Faults,
    /// Number of the next datagram.
    number: u32,
    /// A datagram that is sent after the next one.
    held: Option<Vec<u8>>,
    /// Datagrams that were not sent.
    pub lost: u64,
}

impl Group {
    /// Opens a socket for datagrams that leave by an interface; unspecified: the system chooses it.
    pub fn open(to: SocketAddrV4, interface: Ipv4Addr, faults: Faults) -> io::Result<Self> {
        Ok(Self {
            socket: UdpSocket::bind((interface, 0))?,
            to,
            faults,
            number: 0,
            held: None,
            lost: 0,
        })
    }

    /// Sends the radar's description of itself, and no powers.
    pub fn describe(&mut self, radar: &Configuration) {
        let mut datagram = Vec::new();
        write_description(&mut datagram, radar, self.number);
        self.number = self.number.wrapping_add(1);
        self.pass(&datagram);
    }

    /// Sends an azimuth in several datagrams, with the faults of a network.
    pub fn send(&mut self, radar: &Configuration, azimuth: &Azimuth<'_>) {
        let (first, mut next) = (self.number, self.number);
        let mut datagrams = Vec::new();
        write_azimuth(radar, azimuth, &mut next, &mut |datagram| {
            datagrams.push(datagram.to_vec());
        });
        self.number = next;
        for (k, datagram) in datagrams.into_iter().enumerate() {
            self.send_or_fail(u64::from(first.wrapping_add(k as u32)), datagram);
        }
    }

    /// Loses, doubles or delays a datagram, as its number determines.
    fn send_or_fail(&mut self, number: u64, datagram: Vec<u8>) {
        if self.faults.loses_datagram(number) {
            self.lost += 1;
            return;
        }
        if self.held.is_none() && self.faults.swaps(number) {
            self.held = Some(datagram);
            return;
        }
        self.pass(&datagram);
        if self.faults.doubles(number) {
            self.pass(&datagram);
        }
        if let Some(held) = self.held.take() {
            self.pass(&held);
        }
    }

    /// Sends a datagram as it is. Nobody need be there to receive it.
    pub fn pass(&mut self, datagram: &[u8]) {
        if self.socket.send_to(datagram, self.to).is_err() {
            self.lost += 1;
        }
    }
}
