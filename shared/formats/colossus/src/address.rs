//! The address where a radar is received.

use std::{
    fmt,
    net::{Ipv4Addr, SocketAddrV4},
};

use thiserror::Error;

use crate::PORT;

const UDP: &str = "udp://";
const UNUSED: &str =
    "interface is set, but only an address that begins with `udp://` needs one: remove it";

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    Tcp(String),
    /// The destination of the radar's datagrams.
    Udp {
        to: SocketAddrV4,
        /// The address of this machine on the radar's network; unspecified: the system chooses.
        interface: Ipv4Addr,
    },
}

/// An address that cannot be used: a sentence.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct BadAddress(String);

impl Address {
    /// Parses `HOST`, `HOST:PORT` or `udp://GROUP:PORT`, for the last with an interface or "".
    pub fn parse(text: &str, interface: &str) -> Result<Self, BadAddress> {
        let Some(to) = text.strip_prefix(UDP) else {
            return match interface {
                "" if text.contains(':') => Ok(Self::Tcp(text.to_owned())),
                "" => Ok(Self::Tcp(format!("{text}:{PORT}"))),
                _ => Err(BadAddress(UNUSED.to_owned())),
            };
        };
        let bad = |_| {
            BadAddress(format!(
                "address `{text}` is invalid for datagrams: give group and port, as in `udp://239.192.43.78:4378`"
            ))
        };
        let own = |_| {
            BadAddress(format!(
                "interface `{interface}` is no IPv4 address: give this machine's, as in `192.168.0.2`"
            ))
        };
        Ok(Self::Udp {
            to: to.parse().map_err(bad)?,
            interface: match interface {
                "" => Ipv4Addr::UNSPECIFIED,
                interface => interface.parse().map_err(own)?,
            },
        })
    }

    pub fn is_udp(&self) -> bool {
        matches!(self, Self::Udp { .. })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => f.write_str(address),
            Self::Udp { to, .. } => write!(f, "{UDP}{to}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_parsed_as_they_are_written() {
        let parse = |text, interface| Address::parse(text, interface).map(|it| it.to_string());
        assert_eq!(parse("10.0.0.1", "").as_deref(), Ok("10.0.0.1:6317"));
        assert_eq!(parse("radar:99", "").as_deref(), Ok("radar:99"));
        let group = "udp://239.192.43.78:4378";
        assert_eq!(parse(group, "").as_deref(), Ok(group));
        assert_eq!(parse(group, "127.0.0.1").as_deref(), Ok(group));
        for (address, interface, words) in [
            ("radar", "127.0.0.1", "remove it"),
            ("udp://239.192.43.78", "", "give group and port"),
            (group, "eth0", "interface `eth0` is no IPv4 address"),
        ] {
            let BadAddress(refused) = parse(address, interface).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
    }
}
