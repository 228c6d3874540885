//! Datagrams of live sensors: lines of text.

use std::net::UdpSocket;

use crate::StageError;

/// The largest datagram, bytes: that of UDP.
pub(crate) const MAX_DATAGRAM: usize = 65_536;

/// Opens the socket for what a section receives, which does not block.
///
/// # Errors
/// An address at which nothing can be received.
pub(crate) fn listen(what: &str, section: &str, address: &str) -> Result<UdpSocket, StageError> {
    let bound = UdpSocket::bind(address);
    let opened = bound.and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
    opened.map_err(|error| {
        StageError::Input(format!(
            "cannot receive the {what} at {address} ({section}.listen): {error}"
        ))
    })
}

/// Returns the lines of a datagram; one that is not text has one that says so.
pub(crate) fn lines(datagram: &[u8]) -> impl Iterator<Item = &str> {
    str::from_utf8(datagram).unwrap_or("not text").lines()
}
