//! The fixes of a GNSS receiver that is beside the driver.

use std::{
    io,
    net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket},
};

use gyre_client::{RunError, clock};
use gyre_ros2_messages::sensor_msgs::NavSatFix;
use ros2_client::Subscription;

use super::wakeups::Wakeups;
use crate::node::Node;

/// Fixes that are kept: ten seconds of 20 a second.
const FIXES: usize = 200;

/// Passes each message on as the line that a live receiver would send (`gnss.listen`). Fixes do not
/// travel with scans: no stage needs them.
pub struct Fixes {
    topic: Subscription<NavSatFix>,
    socket: UdpSocket,
    listen: SocketAddr,
    has_failed: bool,
}

impl Fixes {
    pub fn open(
        node: &mut Node,
        wakeups: &mut Wakeups,
        topic: &str,
        listen: &str,
    ) -> Result<Self, RunError> {
        let failed = |error: io::Error| {
            RunError::Input(format!(
                "cannot pass the fixes of GNSS on to {listen} (gnss.listen): {error}"
            ))
        };
        let (socket, listen) = socket_to(listen).map_err(failed)?;
        Ok(Self {
            topic: wakeups.subscribe(node, topic, FIXES, true)?,
            socket,
            listen,
            has_failed: false,
        })
    }

    /// Passes on the arrived fixes, up to the number that is kept. Those who receive it count lines
    /// that are no fix.
    pub fn pass_on(&mut self) {
        for _ in 0..FIXES {
            let line = match self.topic.take() {
                Ok(None) => return,
                Ok(Some((message, _))) => message.line(clock::since_1970_ns()),
                Err(error) => error.to_string(),
            };
            if let Err(error) = self.socket.send_to(line.as_bytes(), self.listen)
                && !std::mem::replace(&mut self.has_failed, true)
            {
                tracing::warn!(listen = %self.listen, "fixes of GNSS cannot be passed on: {error}");
            }
        }
    }
}

fn socket_to(address: &str) -> io::Result<(UdpSocket, SocketAddr)> {
    let first = address.to_socket_addrs()?.next();
    let to = first.ok_or(io::ErrorKind::AddrNotAvailable)?;
    let from: SocketAddr = match to.is_ipv4() {
        true => (Ipv4Addr::UNSPECIFIED, 0).into(),
        false => (Ipv6Addr::UNSPECIFIED, 0).into(),
    };
    Ok((UdpSocket::bind(from)?, to))
}
