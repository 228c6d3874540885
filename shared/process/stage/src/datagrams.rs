//! Datagrams of live sensors: lines of text.

use std::{
    io::ErrorKind::{Interrupted, WouldBlock},
    net::UdpSocket,
    os::fd::AsRawFd,
};

use gyre_transport::RunError;

pub(crate) const MAX_DATAGRAM: usize = 65_536;

pub(crate) fn listen(what: &str, section: &str, address: &str) -> Result<UdpSocket, RunError> {
    let bound = UdpSocket::bind(address);
    let opened = bound.and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
    opened.map_err(|error| {
        RunError::Input(format!(
            "cannot receive the {what} at {address} ({section}.listen): {error}"
        ))
    })
}

/// Bytes of a turn: the samples of a scan, or as many datagrams of a line each, which count as
/// [`LEAST_BYTES`], as a socket holds by default.
pub(crate) const TURN_BYTES: usize = 1 << 16;
const LEAST_BYTES: usize = 128;

/// Receives a datagram that has arrived, and returns its size; `None` if no datagram waits, and
/// where nothing is `left` of the turn, so that a sender without a pause holds nothing up.
pub(crate) fn receive(
    socket: &UdpSocket,
    datagram: &mut [u8],
    left: &mut usize,
) -> Result<Option<usize>, RunError> {
    match (*left > 0).then(|| socket.recv(datagram)) {
        None => Ok(None),
        Some(Ok(bytes)) => {
            *left = left.saturating_sub(bytes.max(LEAST_BYTES));
            Ok(Some(bytes))
        }
        Some(Err(error)) if matches!(error.kind(), WouldBlock | Interrupted) => Ok(None),
        Some(Err(error)) => Err(RunError::transport("receive datagrams", error)),
    }
}

pub(crate) fn dropped(socket: &UdpSocket) -> u32 {
    // Its last number is `SK_MEMINFO_DROPS` of `linux/sock_diag.h`.
    let mut counts = [0_u32; 9];
    let mut bytes = size_of_val(&counts) as libc::socklen_t;
    let (fd, to) = (socket.as_raw_fd(), counts.as_mut_ptr().cast());
    // SAFETY: the system writes at most `bytes` bytes to `counts`, which has as many.
    unsafe { libc::getsockopt(fd, libc::SOL_SOCKET, libc::SO_MEMINFO, to, &mut bytes) };
    counts[8]
}

/// Returns the lines of a datagram; for a datagram that is not text, a line that reports this.
pub(crate) fn lines(datagram: &[u8]) -> impl Iterator<Item = &str> {
    str::from_utf8(datagram).unwrap_or("not text").lines()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sender_without_a_pause_holds_nothing_up_and_what_has_no_room_is_counted() {
        let socket = listen("samples", "gyro", "127.0.0.1:0").unwrap();
        let (to, mut datagram) = (socket.local_addr().unwrap(), [0; 8]);
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let send = || sender.send_to(b"1,2", to).map(drop).unwrap();
        send();
        // Each datagram that is received brings the next one.
        let (mut left, mut received) = (TURN_BYTES, 0);
        while let Some(3) = receive(&socket, &mut datagram, &mut left).unwrap() {
            received += 1;
            send();
        }
        assert_eq!(received, TURN_BYTES / LEAST_BYTES);
        (0..3000).for_each(|_| send());
        while let Some(3) = receive(&socket, &mut datagram, &mut { usize::MAX }).unwrap() {
            received += 1;
        }
        assert_eq!(received + dropped(&socket) as usize, 512 + 3001);
    }
}
