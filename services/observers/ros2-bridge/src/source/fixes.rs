//! The fixes of a GNSS receiver that is beside the driver.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};

use gyre_ros2_messages::sensor_msgs::NavSatFix;
use gyre_stage::clock;
use ros2_client::Subscription;

use super::{driver::DriverError, wakeups::Wakeups};
use crate::node::Node;

/// The topic of a receiver, as `nmea_navsat_driver` names it.
pub const TOPIC: &str = "/fix";
/// Fixes that are kept: ten seconds of 20 a second.
const FIXES: usize = 200;

/// Where fixes come from, and where they go to.
#[derive(Clone, Debug, PartialEq)]
pub struct FixSettings {
    /// The topic of a receiver.
    pub topic: String,
    /// Who takes them: where the corrected trajectory receives datagrams.
    pub listen: String,
}

/// Passes each message on as the line that a live receiver would send (`gnss.listen`). Fixes do not
/// travel with scans: no stage needs them.
pub struct Fixes {
    topic: Subscription<NavSatFix>,
    socket: UdpSocket,
    listen: SocketAddr,
    has_failed: bool,
}

impl Fixes {
    /// Subscribes.
    ///
    /// # Errors
    /// The name of the topic or the address is none, or the system gives no socket.
    pub fn open(
        node: &mut Node,
        wakeups: &mut Wakeups,
        settings: &FixSettings,
    ) -> Result<Self, DriverError> {
        let mut topic = node.subscribe_to_sensor(&settings.topic, FIXES)?;
        wakeups.add(&mut topic)?;
        let mut addresses = settings.listen.to_socket_addrs()?;
        let listen = addresses.next().ok_or(io::ErrorKind::InvalidInput);
        let listen = listen.map_err(io::Error::from)?;
        let from: SocketAddr = match listen.is_ipv4() {
            true => (Ipv4Addr::UNSPECIFIED, 0).into(),
            false => (Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        Ok(Self {
            topic,
            socket: UdpSocket::bind(from)?,
            listen,
            has_failed: false,
        })
    }

    /// Passes on what has arrived. Those who receive it count lines that are no fix.
    pub fn pass_on(&mut self) {
        loop {
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
