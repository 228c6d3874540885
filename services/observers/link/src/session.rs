//! The session of zenoh: opened with the endpoints and certificates of a link alone.

use std::{
    path::Path,
    sync::mpsc::{TryRecvError, channel},
    thread,
};

use gyre_client::RunError;
use gyre_contract::run::LinkConfig;
use serde_json::{Value, json};
use zenoh::{Config, Session, Wait};

use crate::{error::failed, network::check};

/// Time without a sign of life after which a connection is given up, ms. Messages wait meanwhile.
const LEASE_MS: u64 = 3000;
/// The longest time for which a message waits for the network, us. A side that has gone is known by
/// the lease; on a slow network the buffers of the system may take nothing for seconds.
const MAX_BLOCKED_US: u64 = 900_000_000;

/// Opens the session. A side that connects tries again until the other is there, with pauses
/// that grow to 4 s; meanwhile `pause` is called, which returns true on a request to stop.
/// `None` after one.
pub(crate) fn open(
    link: &LinkConfig,
    mut pause: impl FnMut() -> Result<bool, RunError>,
) -> Result<Option<Session>, RunError> {
    check(link)?;
    let config = Config::from_json5(&settings(link).to_string())
        .map_err(|e| failed("use the settings of the link", &e))?;
    let (sender, opened) = channel();
    // The call does not return before it is connected, whatever signal arrives.
    thread::spawn(move || sender.send(zenoh::open(config).wait()));
    loop {
        match opened.try_recv() {
            Ok(session) => {
                let failed = |e| failed("open the link", &e);
                return session.map(Some).map_err(failed);
            }
            Err(TryRecvError::Disconnected) => {
                return Err(failed("open the link", &"it has failed"));
            }
            Err(TryRecvError::Empty) if pause()? => return Ok(None),
            Err(TryRecvError::Empty) => {}
        }
    }
}

fn settings(link: &LinkConfig) -> Value {
    // A client reaches the others through the side or the router that it connects to.
    let mode = match link.listen.is_empty() {
        true => "client",
        false => "peer",
    };
    json!({
        "mode": mode,
        "connect": {
            "endpoints": link.connect,
            "timeout_ms": -1,
            "exit_on_failure": false,
            "retry": { "period_init_ms": 250, "period_max_ms": 4000, "period_increase_factor": 2 },
        },
        "listen": { "endpoints": link.listen },
        // No discovery: the endpoints are named.
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": {
            "unicast": { "compression": { "enabled": false } },
            "link": {
                "protocols": ["tcp", "tls"],
                "tls": tls(link),
                "tx": {
                    "lease": LEASE_MS,
                    "queue": { "congestion_control": { "block": { "wait_before_close": MAX_BLOCKED_US } } },
                },
            },
        },
    })
}

fn tls(link: &LinkConfig) -> Value {
    if link.certificate.as_os_str().is_empty() {
        return json!({});
    }
    let file = |path: &Path| path.to_string_lossy().into_owned();
    json!({
        "root_ca_certificate": file(&link.ca),
        "listen_private_key": file(&link.key),
        "listen_certificate": file(&link.certificate),
        "connect_private_key": file(&link.key),
        "connect_certificate": file(&link.certificate),
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
    })
}
