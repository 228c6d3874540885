//! Endpoints and certificates: plain TCP on this machine, else TLS with certificates of both sides.

use std::net::IpAddr;

use gyre_client::RunError;
use gyre_contract::run::LinkConfig;

/// The environment variable, and its value, that make zenoh do all its work in one thread.
///
/// By default zenoh (1.10) reads from and writes to a TLS connection in two threads at once, which
/// the connection does not allow (eclipse-zenoh/zenoh#2557): under load it breaks within seconds.
/// Set it before the program starts.
pub const ONE_THREAD: (&str, &str) = (
    "ZENOH_RUNTIME",
    "(rx:(handover:app),tx:(handover:app),acc:(handover:app),net:(handover:app),app:(worker_threads:1))",
);

/// The suffixes of names that no public authority certifies: private zones, and names reserved for
/// documents.
const PRIVATE_ZONES: &str = ".internal .lan .local .home.arpa .test .example .localhost";

/// Checks the endpoints, and that the files of TLS can be read.
pub fn check(link: &LinkConfig) -> Result<(), RunError> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if link.name.is_empty() || !link.name.chars().all(is_word) {
        return Err(RunError::Input(format!(
            "`{}` is no name of a link: it has letters, digits, `-` and `_`",
            link.name
        )));
    }
    if link.listen.is_empty() && link.connect.is_empty() {
        return Err(RunError::Input(
            "no endpoint is named: give one side `listen`, as in tls/0.0.0.0:7447, and the other `connect`, as in tls/base.internal:7447".to_owned(),
        ));
    }
    for endpoint in link.listen.iter().chain(&link.connect) {
        if is_tls(endpoint)? {
            check_certificates(link, endpoint)?;
        }
    }
    // A side that connects also trusts the public authorities (zenoh adds `ca` to them), whose
    // certificates others can have.
    match link.connect.iter().find(|endpoint| is_public(endpoint)) {
        Some(endpoint) => Err(RunError::Input(format!(
            "{endpoint} has a public name or address, for which others can obtain a publicly trusted certificate: connect to a private address, or to a name within `.internal` (in /etc/hosts, and in the certificate)"
        ))),
        None => Ok(()),
    }
}

fn check_certificates(link: &LinkConfig, endpoint: &str) -> Result<(), RunError> {
    for (what, path) in [
        ("the authority's certificate (ca)", &link.ca),
        ("a certificate (certificate)", &link.certificate),
        ("a private key (key)", &link.key),
    ] {
        if path.as_os_str().is_empty() {
            return Err(RunError::Input(format!(
                "{endpoint} needs {what}: both sides show a certificate that the same authority has signed (docs/link.md has the recipe)"
            )));
        }
        std::fs::read(path).map_err(|reason| {
            let path = path.display();
            RunError::Input(format!("{what} {path} cannot be read: {reason}"))
        })?;
    }
    Ok(())
}

fn is_tls(endpoint: &str) -> Result<bool, RunError> {
    let malformed = || {
        RunError::Input(format!(
            "`{endpoint}` is no endpoint: it is tls/HOST:PORT, or on this machine tcp/127.0.0.1:PORT"
        ))
    };
    let (protocol, address) = endpoint.split_once('/').ok_or_else(malformed)?;
    // After these characters zenoh reads settings of its own, certificates among them.
    if address.contains(['#', '?', ';', '/']) {
        return Err(malformed());
    }
    let (host, port) = address.rsplit_once(':').ok_or_else(malformed)?;
    if host.is_empty() || port.parse::<u16>().is_err() {
        return Err(malformed());
    }
    match protocol {
        "tls" => Ok(true),
        "tcp" if is_loopback(host) => Ok(false),
        "tcp" => Err(RunError::Input(format!(
            "{endpoint} would leave this machine unencrypted, and anybody could connect: use tls/ with certificates (docs/link.md); tcp/ is for loopback addresses alone"
        ))),
        _ => Err(malformed()),
    }
}

/// Returns whether a public authority might certify the host of an endpoint for somebody else.
fn is_public(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, it)| it);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    match host.trim_matches(['[', ']']).parse::<IpAddr>() {
        Ok(IpAddr::V4(it)) => {
            // 100.64.0.0/10: networks behind a provider, and most private overlays.
            let is_shared = it.octets()[0] == 100 && (64..128).contains(&it.octets()[1]);
            !(it.is_private() || it.is_loopback() || it.is_link_local() || is_shared)
        }
        Ok(IpAddr::V6(it)) => {
            !(it.is_loopback() || it.is_unique_local() || it.is_unicast_link_local())
        }
        Err(_) => {
            let name = host.trim_end_matches('.').to_ascii_lowercase();
            name.contains('.') && !PRIVATE_ZONES.split(' ').any(|zone| name.ends_with(zone))
        }
    }
}

fn is_loopback(host: &str) -> bool {
    let address = host.trim_matches(['[', ']']).parse();
    // A name could be resolved to any address.
    address.is_ok_and(|address: IpAddr| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listening(endpoint: &str) -> LinkConfig {
        LinkConfig {
            name: "robot-1".to_owned(),
            listen: vec![endpoint.to_owned()],
            ..LinkConfig::default()
        }
    }

    fn refusal(network: &LinkConfig) -> String {
        check(network).unwrap_err().to_string()
    }

    #[test]
    fn endpoints_are_tls_or_on_this_machine_and_smuggle_no_settings_of_zenoh_in() {
        let (plain, malformed) = ("would leave this machine unencrypted", "is no endpoint");
        for endpoint in ["tcp/127.0.0.1:7447", "tcp/127.1.2.3:1", "tcp/[::1]:7447"] {
            assert!(check(&listening(endpoint)).is_ok(), "{endpoint}");
        }
        let off = "tcp/0.0.0.0:1 tcp/[::]:1 tcp/192.168.0.1:1 tcp/localhost:1";
        let others = " 7447 udp/127.0.0.1:7447 tls/:7447 tls/base tls/base:port";
        let smuggling = "tls/base:7447#enable_mtls=false tcp/127.0.0.1:7447?rel=0";
        for (endpoints, words) in [(off, plain), (others, malformed), (smuggling, malformed)] {
            for endpoint in endpoints.split(' ') {
                let refused = refusal(&listening(endpoint));
                assert!(refused.contains(words), "{endpoint}: {refused}");
            }
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
        assert!(refusal(&network).contains("(ca)"));
        network.ca = file("ca.pem");
        assert!(refusal(&network).contains("(certificate)"));
        network.certificate = file("robot.pem");
        assert!(refusal(&network).contains("(key)"));
        network.key = folder.path().join("missing.key");
        assert!(refusal(&network).contains("cannot be read"));
        network.key = file("robot.key");
        assert!(check(&network).is_ok());
    }

    #[test]
    fn a_side_that_connects_trusts_no_public_authority() {
        let private = "10.1.2.3 192.168.0.7 100.101.2.3 [fd00::1] [fe80::1] base base.internal base.example Robot.Local.";
        let public = "192.0.2.1 100.63.0.1 [2001:db8::1] base.example.com x.internal.org";
        for (hosts, expected) in [(private, false), (public, true)] {
            for host in hosts.split(' ') {
                assert_eq!(is_public(&format!("tls/{host}:7447")), expected, "{host}");
            }
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = || file.path().to_owned();
        let network = LinkConfig {
            name: "robot-1".to_owned(),
            connect: vec!["tls/base.example.com:7447".to_owned()],
            ca: path(),
            certificate: path(),
            key: path(),
            ..LinkConfig::default()
        };
        assert!(refusal(&network).contains("public name"));
    }

    #[test]
    fn a_link_has_a_name_and_an_endpoint() {
        for name in ["", "a/b", "*", "rob ot"] {
            let mut network = listening("tcp/127.0.0.1:7447");
            network.name = name.to_owned();
            assert!(refusal(&network).contains("is no name"));
        }
        let mut nowhere = listening("");
        nowhere.listen.clear();
        assert!(refusal(&nowhere).contains("no endpoint"));
    }
}
