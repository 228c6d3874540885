//! The domain of ROS 2 and the network interface.

use std::{env, net::Ipv4Addr};

/// The variable of ROS 2 that names the domain.
const DOMAIN: &str = "ROS_DOMAIN_ID";
/// The variables of ROS 2 that keep it on this computer, and the value of each that does.
const ON_THIS_COMPUTER: [(&str, &str); 2] = [
    ("ROS_LOCALHOST_ONLY", "1"),
    ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
];
/// The highest domain whose ports are below 65536.
const MAX_DOMAIN: u16 = 232;

/// A domain of ROS 2, and the network on which it is joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Domain {
    pub id: u16,
    /// Address of this machine on the only network that is used; `None`: all networks.
    pub interface: Option<Ipv4Addr>,
}

impl Domain {
    /// Returns the domain of this number, or of the variable `ROS_DOMAIN_ID`, or 0; on the network
    /// on which this machine has this address, or on all. Where ROS 2 is restricted to this
    /// computer (`ROS_LOCALHOST_ONLY=1`, `ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`), no address
    /// means the loopback.
    pub fn new(id: Option<u16>, interface: Option<&str>) -> Result<Self, String> {
        let variable = |name: &str| env::var(name).ok().filter(|value| !value.is_empty());
        Self::of(id, interface, &variable)
    }

    fn of(
        id: Option<u16>,
        interface: Option<&str>,
        variable: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Self, String> {
        let range = format!("from 0 to {MAX_DOMAIN}");
        let id = match (id, variable(DOMAIN)) {
            (Some(id), _) => id,
            (None, None) => 0,
            (None, Some(text)) => text
                .parse()
                .map_err(|_| format!("{DOMAIN} is `{text}`, but must be a number {range}"))?,
        };
        if id > MAX_DOMAIN {
            let reason = format!("domains of ROS 2 are numbers {range}");
            return Err(format!("domain {id} does not exist: {reason}"));
        }
        let stays = |(name, value): &(&str, &str)| variable(name).as_deref() == Some(*value);
        let interface = match interface {
            Some(text) => Some(text.parse().map_err(|_| {
                format!(
                    "interface `{text}` is no IPv4 address: give this machine's, as in `192.168.0.2`, or `127.0.0.1` for this computer alone"
                )
            })?),
            None => {
                let is_restricted = ON_THIS_COMPUTER.iter().any(stays);
                is_restricted.then_some(Ipv4Addr::LOCALHOST)
            }
        };
        Ok(Self { id, interface })
    }

    /// Returns whether other machines can take part.
    pub fn is_open(&self) -> bool {
        self.interface.is_none_or(|address| !address.is_loopback())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn domain(
        id: Option<u16>,
        interface: Option<&str>,
        set: &[(&str, &str)],
    ) -> Result<Domain, String> {
        let variable = |name: &str| {
            let found = set.iter().find(|(variable, _)| *variable == name);
            found.map(|(_, value)| (*value).to_owned())
        };
        Domain::of(id, interface, &variable)
    }

    #[test]
    fn the_domain_is_that_of_ros_unless_it_is_given() {
        let of = |id, set: &[_]| domain(id, None, set).map(|domain| domain.id);
        assert_eq!(of(None, &[]), Ok(0));
        assert_eq!(of(None, &[(DOMAIN, "42")]), Ok(42));
        assert_eq!(of(Some(7), &[(DOMAIN, "42")]), Ok(7));
        for (refused, expected) in [
            (of(Some(233), &[]), "domain 233 does not exist"),
            (of(None, &[(DOMAIN, "robots")]), "ROS_DOMAIN_ID is `robots`"),
        ] {
            assert!(refused.unwrap_err().starts_with(expected));
        }
    }

    #[test]
    fn ros_that_stays_on_this_computer_keeps_the_bridge_there() {
        let is_open =
            |interface, set: &[_]| domain(None, interface, set).map(|domain| domain.is_open());
        assert_eq!(is_open(None, &[]), Ok(true));
        for (name, value) in ON_THIS_COMPUTER {
            assert_eq!(is_open(None, &[(name, value)]), Ok(false));
        }
        let restricted = [("ROS_LOCALHOST_ONLY", "1")];
        assert_eq!(is_open(Some("192.168.0.2"), &restricted), Ok(true));
        assert_eq!(is_open(Some("127.0.0.1"), &[]), Ok(false));
        assert!(is_open(Some("lo"), &[]).unwrap_err().contains("`lo`"));
    }
}
