//! Copies through Unix stream sockets. Each message is its number and the time of its sending, 16
//! bytes, then its content.

use std::{
    io::{ErrorKind, Read, Write},
    os::{
        fd::AsFd,
        unix::net::{UnixListener, UnixStream},
    },
    time::Instant,
};

use gyre_stage::clock;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::{HandOver, sending::Send};
use crate::StressError;

const HEAD: usize = 16;

/// The sender: one socket for each reader. It writes to whichever has room, so that no reader waits
/// for another.
pub(super) struct Sender {
    listener: UnixListener,
    readers: usize,
    streams: Vec<UnixStream>,
    message: Vec<u8>,
}

impl Sender {
    pub fn create(plan: &HandOver) -> Result<Self, StressError> {
        let path = plan.socket();
        let listener = UnixListener::bind(&path).map_err(StressError::file(&path))?;
        Ok(Self {
            listener,
            readers: plan.readers,
            streams: Vec::new(),
            message: vec![0; HEAD + plan.bytes],
        })
    }
}

impl Send for Sender {
    fn begin(&mut self) -> Result<(), StressError> {
        for _ in 0..self.readers {
            let (stream, _) = self
                .listener
                .accept()
                .map_err(StressError::file("socket"))?;
            let set = stream.set_nonblocking(true);
            set.map_err(StressError::file("socket"))?;
            self.streams.push(stream);
        }
        Ok(())
    }

    fn write(&mut self, number: u64) -> Result<(), StressError> {
        self.message[HEAD..].fill(number as u8);
        self.message[..8].copy_from_slice(&number.to_le_bytes());
        Ok(())
    }

    fn send(&mut self) -> Result<(), StressError> {
        self.message[8..HEAD].copy_from_slice(&clock::now_ns().to_le_bytes());
        let mut written = vec![0; self.streams.len()];
        loop {
            for (stream, written) in self.streams.iter_mut().zip(&mut written) {
                fill(stream, &self.message, written)?;
            }
            let behind = self.streams.iter().zip(&written);
            let behind = behind.filter(|(_, written)| **written < self.message.len());
            let mut polled: Vec<_> = behind
                .map(|(stream, _)| PollFd::from_borrowed_fd(stream.as_fd(), PollFlags::OUT))
                .collect();
            if polled.is_empty() {
                return Ok(());
            }
            wait(&mut polled, None)?;
        }
    }

    fn shared_bytes(&self) -> u64 {
        0
    }
}

/// Writes as much as the socket takes.
fn fill(stream: &mut UnixStream, message: &[u8], written: &mut usize) -> Result<(), StressError> {
    while *written < message.len() {
        match stream.write(&message[*written..]) {
            Ok(bytes) => *written += bytes,
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) => return Err(StressError::file("socket")(error)),
        }
    }
    Ok(())
}

/// A message that was read.
pub(super) struct Message<'a> {
    pub number: u64,
    /// When its sending began, `CLOCK_MONOTONIC`, ns.
    pub sent_ns: i64,
    pub content: &'a [u8],
}

/// A reader: each message is copied into its own memory.
pub(super) struct Receiver {
    stream: UnixStream,
    message: Vec<u8>,
}

impl Receiver {
    pub fn connect(plan: &HandOver) -> Result<Self, StressError> {
        let path = plan.socket();
        let stream = UnixStream::connect(&path).map_err(StressError::file(&path))?;
        let set = stream.set_nonblocking(true);
        set.map_err(StressError::file(&path))?;
        Ok(Self {
            stream,
            message: vec![0; HEAD + plan.bytes],
        })
    }

    /// Returns the next message; `None` after the deadline or the end.
    pub fn next(&mut self, deadline: Instant) -> Result<Option<Message<'_>>, StressError> {
        let mut read = 0;
        while read < self.message.len() {
            match self.stream.read(&mut self.message[read..]) {
                Ok(0) => return Ok(None),
                Ok(bytes) => read += bytes,
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    let polled = PollFd::from_borrowed_fd(self.stream.as_fd(), PollFlags::IN);
                    if !wait(&mut [polled], Some(deadline))? {
                        return Ok(None);
                    }
                }
                Err(error) => return Err(StressError::file("socket")(error)),
            }
        }
        let number = |at: usize| {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(&self.message[at..at + 8]);
            u64::from_le_bytes(bytes)
        };
        Ok(Some(Message {
            number: number(0),
            sent_ns: number(8) as i64,
            content: &self.message[HEAD..],
        }))
    }
}

/// Sleeps until a socket is ready; false after the deadline.
fn wait(polled: &mut [PollFd<'_>], deadline: Option<Instant>) -> Result<bool, StressError> {
    let limit = deadline.map(|deadline| {
        let left = deadline.saturating_duration_since(Instant::now());
        Timespec {
            tv_sec: left.as_secs() as i64,
            tv_nsec: i64::from(left.subsec_nanos()),
        }
    });
    match poll(polled, limit.as_ref()) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(true),
        Err(error) => Err(StressError::file("socket")(error.into())),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{thread, time::Duration};

    use super::*;
    use crate::copying::Medium;

    #[test]
    fn each_reader_gets_all_bytes_of_each_message() {
        let folder = tempfile::tempdir().unwrap();
        let plan = HandOver {
            medium: Medium::Sockets,
            place: folder.path().to_owned(),
            // More than a socket holds.
            bytes: 1 << 20,
            messages: 3,
            readers: 2,
        };
        let mut sender = Sender::create(&plan).unwrap();
        let read = |mut stream: Receiver| {
            for number in 0..3 {
                let deadline = Instant::now() + Duration::from_secs(30);
                let message = stream.next(deadline).unwrap().unwrap();
                assert_eq!((message.number, message.content.len()), (number, 1 << 20));
                let is_sent = |byte: &u8| *byte == number as u8;
                assert!(message.sent_ns > 0 && message.content.iter().all(is_sent));
            }
        };
        let streams = [0; 2].map(|_| Receiver::connect(&plan).unwrap());
        let readers = streams.map(|stream| thread::spawn(move || read(stream)));
        sender.begin().unwrap();
        for number in 0..3 {
            sender.write(number).unwrap();
            sender.send().unwrap();
        }
        readers
            .into_iter()
            .for_each(|reader| reader.join().unwrap());
    }
}
