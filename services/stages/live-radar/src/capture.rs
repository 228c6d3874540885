//! What a radar sends, byte for byte, in a file: recorded from a radar, and played as it.
//!
//! A file is [`MAGIC`], a byte for the protocol (0: TCP, 1: datagrams), and records up to its end: nanoseconds since the start and number
//! of bytes (u64, u32, little-endian), then the bytes, as they were read, or one datagram. A last record that is cut is left out.

use std::{
    fs::{self, File},
    io::{self, BufReader, ErrorKind, Read, Write},
    path::{Path, PathBuf},
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::{Configuration, Datagrams, Event, Message, Parser, Request};
use thiserror::Error;

use crate::{
    Address, Settings,
    connection::Link,
    server::{Audience, Clients, Faults, Group},
};

/// The first bytes of a capture, with its version.
pub const MAGIC: &[u8; 8] = b"GYRERAD1";
/// The most bytes of a record.
const MAX_RECORD_BYTES: usize = 1 << 16;
/// Time between two looks for bytes, or for a request to stop.
const LOOK: Duration = Duration::from_millis(2);
/// The longest time without a look for a request to stop while nothing is due.
const SLICE: Duration = Duration::from_millis(50);
/// Time between two descriptions of a radar that sends nothing yet.
const DESCRIBE_PERIOD: Duration = Duration::from_millis(100);
/// Encoder counts of a description by UDP, which has none. They are not sent.
const ENCODER_COUNTS: u16 = 5600;

/// Why a capture cannot be made or played.
#[derive(Debug, Error)]
pub enum CaptureError {
    /// The radar.
    #[error("no radar answers at {address} ({source}): check the address")]
    NoAnswer {
        /// Its address.
        address: String,
        /// The system's reason.
        source: io::Error,
    },
    /// The file.
    #[error("{}: {source}", path.display())]
    File {
        /// Its path.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// It is none.
    #[error("{} is a damaged capture: {reason}", path.display())]
    Damaged {
        /// Its path.
        path: PathBuf,
        /// What is wrong.
        reason: &'static str,
    },
    /// The other protocol.
    #[error("{} was captured by {of}, and can only be played so: {advice}", path.display())]
    Protocol {
        /// Its path.
        path: PathBuf,
        /// The protocol.
        of: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// The network.
    #[error("cannot serve as a radar: {0}")]
    Network(#[from] io::Error),
}

/// What was recorded or played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Captured {
    /// Records.
    pub records: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// Records what a radar sends until it ends, or `stop` says so.
///
/// # Errors
/// No radar answers, or the file cannot be written.
pub fn record(
    settings: &Settings,
    path: &Path,
    stop: &dyn Fn() -> bool,
) -> Result<Captured, CaptureError> {
    let file = |source| CaptureError::File {
        path: path.to_owned(),
        source,
    };
    // Before the radar is asked for anything: a file that is there is not overwritten.
    let mut out = io::BufWriter::new(File::create_new(path).map_err(file)?);
    let requests = [Request::RequestConfiguration, Request::StartFft];
    let mut link = match Link::open(&settings.address, &requests) {
        Ok(link) => link,
        Err(source) => {
            // It is empty.
            let _ = fs::remove_file(path);
            return Err(CaptureError::NoAnswer {
                address: settings.address.to_string(),
                source,
            });
        }
    };
    let is_udp = matches!(settings.address, Address::Udp { .. });
    out.write_all(MAGIC).map_err(file)?;
    out.write_all(&[is_udp.into()]).map_err(file)?;
    let (started, mut space) = (Instant::now(), vec![0; MAX_RECORD_BYTES]);
    let mut captured = Captured::default();
    while !stop() {
        match link.read(&mut space) {
            Ok((count, _)) => {
                let bytes = &space[..count];
                write_record(&mut out, started.elapsed(), bytes).map_err(file)?;
                captured.records += 1;
                captured.bytes += count as u64;
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => sleep(LOOK),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => {
                tracing::info!("the radar has ended: {error}");
                break;
            }
        }
    }
    out.flush().map_err(file)?;
    Ok(captured)
}

fn write_record(out: &mut impl Write, time: Duration, bytes: &[u8]) -> io::Result<()> {
    out.write_all(&(time.as_nanos() as u64).to_le_bytes())?;
    out.write_all(&(bytes.len() as u32).to_le_bytes())?;
    out.write_all(bytes)
}

/// A capture that is read from its start.
#[derive(Debug)]
pub struct Capture {
    path: PathBuf,
    file: BufReader<File>,
    is_udp: bool,
}

impl Capture {
    /// Opens a capture; `None` if the file is something else, or a folder.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn open(path: &Path) -> Result<Option<Self>, CaptureError> {
        let failed = |source| CaptureError::File {
            path: path.to_owned(),
            source,
        };
        if !path.is_file() {
            return Ok(None);
        }
        let mut file = BufReader::new(File::open(path).map_err(failed)?);
        let mut head = [0; MAGIC.len() + 1];
        let is_one = read_whole(&mut file, &mut head).map_err(failed)?;
        if !is_one || !head.starts_with(MAGIC) {
            return Ok(None);
        }
        let path = path.to_owned();
        match head[MAGIC.len()] {
            protocol @ 0..=1 => Ok(Some(Self {
                path,
                file,
                is_udp: protocol == 1,
            })),
            _ => Err(CaptureError::Damaged {
                path,
                reason: "its protocol is unknown",
            }),
        }
    }

    /// Reads the next record; its time and its number of bytes.
    fn next(&mut self, bytes: &mut [u8]) -> Result<Option<(Duration, usize)>, CaptureError> {
        let mut head = [0; 12];
        let failed = |source| CaptureError::File {
            path: self.path.clone(),
            source,
        };
        if !read_whole(&mut self.file, &mut head).map_err(failed)? {
            return Ok(None);
        }
        let [t0, t1, t2, t3, t4, t5, t6, t7, c0, c1, c2, c3] = head;
        let time_ns = u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
        let count = u32::from_le_bytes([c0, c1, c2, c3]) as usize;
        let Some(bytes) = bytes.get_mut(..count) else {
            return Err(CaptureError::Damaged {
                path: self.path.clone(),
                reason: "a record has more bytes than any has",
            });
        };
        let is_whole = read_whole(&mut self.file, bytes).map_err(failed)?;
        Ok(is_whole.then_some((Duration::from_nanos(time_ns), count)))
    }

    /// Reads up to the radar's first description of itself.
    fn configuration(mut self) -> Result<Configuration, CaptureError> {
        let mut bytes = vec![0; MAX_RECORD_BYTES];
        let (mut stream, mut datagrams) = (Parser::new(), Datagrams::new(ENCODER_COUNTS));
        while let Some((_, count)) = self.next(&mut bytes)? {
            let record = &bytes[..count];
            let mut found = None;
            let mut note = |event: Event<'_>| {
                if let Event::Message(Message::Configuration(radar)) = event {
                    found = Some(radar);
                }
            };
            if self.is_udp {
                datagrams.space()[..count.min(MAX_RECORD_BYTES)].copy_from_slice(record);
                datagrams.filled(count);
                while let Some(event) = datagrams.next() {
                    note(event);
                }
            } else {
                stream.space(count)[..count].copy_from_slice(record);
                stream.filled(count);
                while let Some(event) = stream.next() {
                    note(event);
                }
            }
            if let Some(radar) = found {
                return Ok(radar);
            }
        }
        Err(CaptureError::Damaged {
            path: self.path,
            reason: "no radar describes itself in it",
        })
    }
}

/// Fills `bytes`; false if the file ends before.
fn read_whole(file: &mut impl Read, bytes: &mut [u8]) -> io::Result<bool> {
    match file.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// Where a capture goes.
enum Output {
    Clients(Clients),
    Group(Group),
}

/// Plays a capture as the radar that it is of, until it has ended or `stop` says so. `rate` is a factor of its pace; `None`: as fast as it
/// is read.
///
/// # Errors
/// A capture that cannot be read or is of the other protocol, or a failure of the network.
pub fn play(
    audience: Audience,
    mut capture: Capture,
    rate: Option<f64>,
    stop: &dyn Fn() -> bool,
) -> Result<Captured, CaptureError> {
    let path = capture.path.clone();
    let mut output = match (audience, capture.is_udp) {
        (Audience::Clients(listener), false) => {
            let radar = again(&path)?.configuration()?;
            let clients = Clients::accept(listener, &radar)?;
            while !clients.any_started() && !stop() {
                sleep(LOOK);
            }
            Output::Clients(clients)
        }
        (
            Audience::Group {
                to,
                interface,
                wait,
            },
            true,
        ) => {
            let radar = again(&path)?.configuration()?;
            let mut group = Group::open(to, interface, Faults::default())?;
            let end = Instant::now() + wait;
            while Instant::now() < end && !stop() {
                group.describe(&radar);
                sleep(DESCRIBE_PERIOD);
            }
            Output::Group(group)
        }
        (_, is_udp) => return Err(other_protocol(path, is_udp)),
    };
    let mut bytes = vec![0; MAX_RECORD_BYTES];
    let (started, mut played) = (Instant::now(), Captured::default());
    while let Some((time, count)) = capture.next(&mut bytes)? {
        let due = rate.map_or(Duration::ZERO, |rate| {
            Duration::try_from_secs_f64(time.as_secs_f64() / rate).unwrap_or(time)
        });
        if !wait_until(started + due, stop) {
            return Ok(played);
        }
        match &mut output {
            Output::Clients(clients) => clients.send(&bytes[..count]),
            Output::Group(group) => group.pass(&bytes[..count]),
        }
        played.records += 1;
        played.bytes += count as u64;
    }
    if let Output::Clients(clients) = &output {
        clients.close();
    }
    Ok(played)
}

/// Opens a capture from its start.
fn again(path: &Path) -> Result<Capture, CaptureError> {
    Capture::open(path)?.ok_or_else(|| CaptureError::Damaged {
        path: path.to_owned(),
        reason: "it is no capture any more",
    })
}

fn other_protocol(path: PathBuf, is_udp: bool) -> CaptureError {
    let (of, advice) = match is_udp {
        true => ("UDP", "give the group as --udp GROUP:PORT"),
        false => ("TCP", "leave out --udp"),
    };
    CaptureError::Protocol { path, of, advice }
}

/// Waits for a time; false on a request to stop.
fn wait_until(due: Instant, stop: &dyn Fn() -> bool) -> bool {
    loop {
        if stop() {
            return false;
        }
        let left = due.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return true;
        }
        sleep(left.min(SLICE));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A file of this test, removed at its end.
    struct Place(PathBuf);

    impl Place {
        fn new(name: &str, bytes: &[u8]) -> Self {
            let name = format!("gyre-capture-{name}-{}", std::process::id());
            let path = std::env::temp_dir().join(name);
            fs::write(&path, bytes).unwrap();
            Self(path)
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            let _ = fs::remove_file(&self.0);
        }
    }

    fn capture() -> Vec<u8> {
        let mut bytes = [&MAGIC[..], &[0]].concat();
        write_record(&mut bytes, Duration::from_millis(3), b"one").unwrap();
        write_record(&mut bytes, Duration::from_secs(90_000), b"other").unwrap();
        bytes
    }

    fn records(path: &Path) -> Result<Vec<(Duration, Vec<u8>)>, CaptureError> {
        let mut capture = Capture::open(path)?.unwrap();
        let (mut space, mut records) = (vec![0; MAX_RECORD_BYTES], Vec::new());
        while let Some((time, count)) = capture.next(&mut space)? {
            records.push((time, space[..count].to_vec()));
        }
        Ok(records)
    }

    #[test]
    fn records_are_read_as_they_were_written_up_to_one_that_is_cut() {
        let whole = [
            (Duration::from_millis(3), b"one".to_vec()),
            (Duration::from_secs(90_000), b"other".to_vec()),
        ];
        let bytes = capture();
        for (cut, left) in [(0, 2), (1, 1), (16, 1), (18, 0)] {
            let file = Place::new(&format!("cut-{cut}"), &bytes[..bytes.len() - cut]);
            assert_eq!(records(&file.0).unwrap(), whole[..left], "{cut}");
        }
    }

    #[test]
    fn what_is_no_capture_is_left_or_named() {
        let file = Place::new("other", b"a file that is something else");
        assert!(Capture::open(&file.0).unwrap().is_none());
        let mut large = capture();
        large.extend([0; 8]);
        large.extend(u32::MAX.to_le_bytes());
        let file = Place::new("large", &large);
        assert!(
            records(&file.0)
                .unwrap_err()
                .to_string()
                .contains("damaged")
        );
        let file = Place::new("protocol", &[&MAGIC[..], &[7]].concat());
        assert!(Capture::open(&file.0).is_err());
        let file = Place::new("nobody", &capture());
        let capture = Capture::open(&file.0).unwrap().unwrap();
        let error = capture.configuration().unwrap_err().to_string();
        assert!(error.contains("no radar describes itself"), "{error}");
    }
}
