//! Who may connect, and how: plain on this machine, else by TLS with certificates of both sides.

use std::{net::IpAddr, path::PathBuf};

use thiserror::Error;

/// The environment variable, and its value, with which the network layer does all its work in one thread.
///
/// By itself zenoh (1.10) reads from and writes to a TLS connection in two threads at once, which the connection does not allow
/// (eclipse-zenoh/zenoh#2557): under load it breaks within seconds. Set it before the program starts; TLS is refused without.
pub const ONE_THREAD: (&str, &str) = (
    "ZENOH_RUNTIME",
    "(rx:(handover:app),tx:(handover:app),acc:(handover:app),net:(handover:app),app:(worker_threads:1))",
);

/// How one side reaches the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Network {
    /// The name of the link, the same on both sides.
    pub name: String,
    /// Endpoints at which this side waits, as in `tls/0.0.0.0:7447`.
    pub listen: Vec<String>,
    /// Endpoints that it connects to.
    pub connect: Vec<String>,
    /// Certificate of the authority, PEM.
    pub ca: PathBuf,
    /// Certificate of this side, PEM.
    pub certificate: PathBuf,
    /// Private key of the certificate, PEM.
    pub key: PathBuf,
}

/// Why a link cannot be made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum NetworkError {
    /// Nothing to connect.
    #[error(
        "no endpoint is named: give one side `listen`, as in tls/0.0.0.0:7447, and the other `connect`, as in tls/base.internal:7447"
    )]
    NoEndpoint,
    /// Not an endpoint.
    #[error("`{0}` is no endpoint: it is tls/HOST:PORT, or on this machine tcp/127.0.0.1:PORT")]
    Malformed(String),
    /// Plain text on a network.
    #[error(
        "{0} would leave this machine unencrypted, and anybody could connect: use tls/ with certificates (docs/link.md); tcp/ is for loopback addresses alone"
    )]
    Plain(String),
    /// TLS without a certificate.
    #[error(
        "{endpoint} needs {what}: both sides show a certificate that the same authority has signed (docs/link.md has the recipe)"
    )]
    NoCertificate {
        /// The endpoint.
        endpoint: String,
        /// What is missing.
        what: &'static str,
    },
    /// A file that is named is not there.
    #[error("{what} {path} cannot be read: {reason}")]
    File {
        /// What it is.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        reason: String,
    },
    /// A host for which a public authority might sign a certificate of somebody else.
    #[error(
        "{0} has a public name or address, for which others can obtain a publicly trusted certificate: connect to a private address, or to a name within `.internal` (in /etc/hosts, and in the certificate)"
    )]
    Public(String),
    /// A name that cannot be part of a key.
    #[error("`{0}` is no name of a link: it has letters, digits, `-` and `_`")]
    Name(String),
}

/// The ends of names that no public authority certifies: private zones, and those of documents.
const PRIVATE_ZONES: [&str; 7] = [
    ".internal",
    ".lan",
    ".local",
    ".home.arpa",
    ".test",
    ".example",
    ".localhost",
];

/// The protocol of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Protocol {
    Tcp,
    Tls,
}

impl Network {
    /// Checks the endpoints, and that the files of TLS can be read.
    ///
    /// # Errors
    /// One sentence that says what is missing.
    pub fn check(&self) -> Result<(), NetworkError> {
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if self.name.is_empty() || !self.name.chars().all(is_word) {
            return Err(NetworkError::Name(self.name.clone()));
        }
        let mut endpoints = self.endpoints().peekable();
        if endpoints.peek().is_none() {
            return Err(NetworkError::NoEndpoint);
        }
        endpoints.try_for_each(|endpoint| match protocol(endpoint)? {
            Protocol::Tcp => Ok(()),
            Protocol::Tls => self.check_certificates(endpoint),
        })?;
        // A side that connects also believes the public authorities (zenoh adds `ca` to them), whose certificates others can have.
        match self.connect.iter().find(|endpoint| is_public(endpoint)) {
            Some(endpoint) => Err(NetworkError::Public(endpoint.clone())),
            None => Ok(()),
        }
    }

    fn endpoints(&self) -> impl Iterator<Item = &str> {
        self.listen.iter().chain(&self.connect).map(String::as_str)
    }

    fn check_certificates(&self, endpoint: &str) -> Result<(), NetworkError> {
        for (what, path) in [
            ("the authority's certificate (ca)", &self.ca),
            ("a certificate (certificate)", &self.certificate),
            ("a private key (key)", &self.key),
        ] {
            if path.as_os_str().is_empty() {
                let endpoint = endpoint.to_owned();
                return Err(NetworkError::NoCertificate { endpoint, what });
            }
            if let Err(error) = std::fs::read(path) {
                return Err(NetworkError::File {
                    what,
                    path: path.clone(),
                    reason: error.to_string(),
                });
            }
        }
        Ok(())
    }
}

/// Returns the protocol of an endpoint that may be used.
fn protocol(endpoint: &str) -> Result<Protocol, NetworkError> {
    let malformed = || NetworkError::Malformed(endpoint.to_owned());
    let (protocol, address) = endpoint.split_once('/').ok_or_else(malformed)?;
    // Behind these signs zenoh would read settings of its own, certificates among them.
    if address.contains(['#', '?', ';', '/']) {
        return Err(malformed());
    }
    let (host, port) = address.rsplit_once(':').ok_or_else(malformed)?;
    if host.is_empty() || port.parse::<u16>().is_err() {
        return Err(malformed());
    }
    match protocol {
        "tls" => Ok(Protocol::Tls),
        "tcp" if is_loopback(host) => Ok(Protocol::Tcp),
        "tcp" => Err(NetworkError::Plain(endpoint.to_owned())),
        _ => Err(malformed()),
    }
}

/// Returns whether a public authority might certify the host of an endpoint for somebody else.
fn is_public(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, it)| it);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    match host.trim_matches(['[', ']']).parse::<IpAddr>() {
        Ok(IpAddr::V4(it)) => {
            // 100.64.0.0/10 is of networks behind a provider, as of most private overlays.
            let is_shared = it.octets()[0] == 100 && (64..128).contains(&it.octets()[1]);
            !(it.is_private() || it.is_loopback() || it.is_link_local() || is_shared)
        }
        Ok(IpAddr::V6(it)) => {
            !(it.is_loopback() || it.is_unique_local() || it.is_unicast_link_local())
        }
        Err(_) => {
            let name = host.trim_end_matches('.').to_ascii_lowercase();
            name.contains('.') && !PRIVATE_ZONES.iter().any(|zone| name.ends_with(zone))
        }
    }
}

fn is_loopback(host: &str) -> bool {
    let address = host.trim_start_matches('[').trim_end_matches(']');
    let loopback = address
        .parse::<IpAddr>()
        .map(|address| address.is_loopback());
    // A name could be resolved to any address.
    loopback.unwrap_or(false)
}

#[cfg(feature = "zenoh")]
mod open {
    use std::{
        path::Path,
        sync::mpsc::{TryRecvError, channel},
        thread,
    };

    use serde_json::{Value, json};
    use zenoh::{Config, Session, Wait};

    use super::{Network, ONE_THREAD};
    use crate::LinkError;

    /// Time without a sign of life after which a connection is given up, ms. A robot drives on meanwhile, and what is sent waits.
    const LEASE_MS: u64 = 3000;

    impl Network {
        /// Opens the network. A side that connects tries again and again until the other is there, more and more seldom until 4 s are between
        /// two attempts; meanwhile `pause` is called, which returns true on a request to stop. `None` after one.
        ///
        /// # Errors
        /// An endpoint or a certificate that cannot be used, or an error of `pause`.
        pub(crate) fn open(
            &self,
            mut pause: impl FnMut() -> Result<bool, LinkError>,
        ) -> Result<Option<Session>, LinkError> {
            self.check()?;
            self.require_one_thread()?;
            let config = Config::from_json5(&self.settings().to_string())
                .map_err(|e| LinkError::zenoh("use the settings of the link", &e))?;
            let (sender, opened) = channel();
            // It does not return before it is connected, whatever signal arrives.
            thread::spawn(move || sender.send(zenoh::open(config).wait()));
            loop {
                match opened.try_recv() {
                    Ok(session) => {
                        let failed = |e| LinkError::zenoh("open the link", &e);
                        return session.map(Some).map_err(failed);
                    }
                    Err(TryRecvError::Disconnected) => {
                        return Err(LinkError::zenoh("open the link", &"it has failed"));
                    }
                    Err(TryRecvError::Empty) if pause()? => return Ok(None),
                    Err(TryRecvError::Empty) => {}
                }
            }
        }

        fn require_one_thread(&self) -> Result<(), LinkError> {
            let (name, value) = ONE_THREAD;
            let is_set = std::env::var_os(name).is_some_and(|set| set == value);
            match is_set || self.certificate.as_os_str().is_empty() {
                true => Ok(()),
                false => Err(LinkError::Refused(format!(
                    "TLS needs {name}='{value}' in the environment, which `gyre run` and `gyre link` set"
                ))),
            }
        }

        fn settings(&self) -> Value {
            // A client reaches the others through the side or the router that it connects to.
            let mode = match self.listen.is_empty() {
                true => "client",
                false => "peer",
            };
            json!({
                "mode": mode,
                "connect": {
                    "endpoints": self.connect,
                    "timeout_ms": -1,
                    "exit_on_failure": false,
                    "retry": { "period_init_ms": 250, "period_max_ms": 4000, "period_increase_factor": 2 },
                },
                "listen": { "endpoints": self.listen },
                // Nobody is looked for: the endpoints are named.
                "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
                "transport": {
                    "unicast": { "compression": { "enabled": false } },
                    "link": {
                        "protocols": ["tcp", "tls"],
                        "tls": self.tls(),
                        "tx": { "lease": LEASE_MS },
                    },
                },
            })
        }

        fn tls(&self) -> Value {
            if self.certificate.as_os_str().is_empty() {
                return json!({});
            }
            let file = |path: &Path| path.to_string_lossy().into_owned();
            json!({
                "root_ca_certificate": file(&self.ca),
                "listen_private_key": file(&self.key),
                "listen_certificate": file(&self.certificate),
                "connect_private_key": file(&self.key),
                "connect_certificate": file(&self.certificate),
                "enable_mtls": true,
                "verify_name_on_connect": true,
                "close_link_on_expiration": true,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn listening(endpoint: &str) -> Network {
        Network {
            name: "robot-1".to_owned(),
            listen: vec![endpoint.to_owned()],
            ..Network::default()
        }
    }

    #[test]
    fn plain_connections_are_for_loopback_addresses_alone() {
        for endpoint in ["tcp/127.0.0.1:7447", "tcp/127.1.2.3:1", "tcp/[::1]:7447"] {
            assert_eq!(listening(endpoint).check(), Ok(()), "{endpoint}");
        }
        for endpoint in [
            "tcp/0.0.0.0:7447",
            "tcp/[::]:7447",
            "tcp/192.168.0.1:7447",
            "tcp/localhost:7447",
            "tcp/robot:7447",
        ] {
            let refused = listening(endpoint).check();
            assert_eq!(refused, Err(NetworkError::Plain(endpoint.to_owned())));
        }
    }

    #[test]
    fn settings_of_zenoh_cannot_be_smuggled_in_with_an_endpoint() {
        for endpoint in [
            "",
            "7447",
            "udp/127.0.0.1:7447",
            "tls/:7447",
            "tls/base",
            "tls/base:port",
            "tls/base:7447#enable_mtls=false",
            "tcp/127.0.0.1:7447?rel=0",
        ] {
            let refused = listening(endpoint).check();
            assert_eq!(refused, Err(NetworkError::Malformed(endpoint.to_owned())));
        }
    }

    #[test]
    fn tls_needs_the_certificates_of_both_sides() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "").unwrap();
            path
        };
        let mut network = listening("tls/0.0.0.0:7447");
        let lacks = |network: &Network| network.check().unwrap_err().to_string();
        assert!(lacks(&network).contains("(ca)"));
        network.ca = file("ca.pem");
        assert!(lacks(&network).contains("(certificate)"));
        network.certificate = file("robot.pem");
        assert!(lacks(&network).contains("(key)"));
        network.key = folder.path().join("missing.key");
        assert!(lacks(&network).contains("cannot be read"));
        network.key = file("robot.key");
        assert_eq!(network.check(), Ok(()));
    }

    #[test]
    fn who_connects_believes_no_public_authority() {
        for host in [
            "10.1.2.3",
            "192.168.0.7",
            "100.101.2.3",
            "[fd00::1]",
            "[fe80::1]",
            "base",
            "base.internal",
            "base.example",
            "Robot.Local.",
        ] {
            assert!(!is_public(&format!("tls/{host}:7447")), "{host}");
        }
        for host in [
            "192.0.2.1",
            "100.63.0.1",
            "[2001:db8::1]",
            "base.example.com",
            "x.internal.org",
        ] {
            let endpoint = format!("tls/{host}:7447");
            assert!(is_public(&endpoint), "{host}");
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = || file.path().to_owned();
        let network = Network {
            name: "robot-1".to_owned(),
            connect: vec!["tls/base.example.com:7447".to_owned()],
            ca: path(),
            certificate: path(),
            key: path(),
            ..Network::default()
        };
        assert!(matches!(network.check(), Err(NetworkError::Public(_))));
    }

    #[test]
    fn a_link_has_a_name_and_an_endpoint() {
        let named = |name: &str| Network {
            name: name.to_owned(),
            ..listening("tcp/127.0.0.1:7447")
        };
        for name in ["", "a/b", "*", "rob ot"] {
            assert_eq!(
                named(name).check(),
                Err(NetworkError::Name(name.to_owned()))
            );
        }
        let nowhere = Network {
            listen: Vec::new(),
            ..named("robot")
        };
        assert_eq!(nowhere.check(), Err(NetworkError::NoEndpoint));
    }
}
