//! Captures: files with the bytes that a radar has sent, recorded from a radar and played as one.
//!
//! A file is [`MAGIC`], a byte for the protocol (0: TCP, 1: datagrams), and records up to its end:
//! nanoseconds since the start and number of bytes (u64, u32, little-endian), then the bytes, as
//! they were read, or one datagram. A last record that is cut is left out.

use std::{
    fs::{self, File},
    io::{self, BufReader, ErrorKind, Read, Write},
    path::{Path, PathBuf},
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::{Address, Configuration, Event, Message, Request};
use gyre_stages::live_radar::{RadarParser, RadarSocket};
use gyre_terminal::Failure;

use crate::radar_server::server::{Output, sleep_until};

/// The first bytes of a capture, with its version.
pub const MAGIC: &[u8; 8] = b"GYRERAD1";
/// The most bytes of a record.
pub const MAX_RECORD_BYTES: usize = 1 << 16;
/// The longest time since the start: a year. A damaged one would be waited for in vain.
const MAX_TIME: Duration = Duration::from_secs(365 * 86_400);
/// Time between two polls for bytes.
const POLL: Duration = Duration::from_millis(2);
/// Encoder counts of a description by UDP, which has none. They are not sent.
const ENCODER_COUNTS: u16 = 5600;

/// Returns a function that names the file of a system error.
fn in_file(path: &Path) -> impl Fn(io::Error) -> String {
    move |error| format!("{}: {error}", path.display())
}

fn damaged(path: &Path, reason: &str) -> Failure {
    format!("{} is a damaged capture: {reason}", path.display()).into()
}

/// The size of a recorded or played capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Captured {
    pub records: u64,
    pub bytes: u64,
}

/// Records the bytes of a radar until it ends, or `stop` returns true.
pub fn record(radar: &Address, path: &Path, stop: &dyn Fn() -> bool) -> Result<Captured, Failure> {
    let file = &in_file(path);
    // Before the radar is asked for anything: a file that is there is not overwritten.
    let mut out = io::BufWriter::new(File::create_new(path).map_err(file)?);
    let requests = [Request::RequestConfiguration, Request::StartFft];
    let mut socket = RadarSocket::open(radar, &requests).map_err(|error| {
        // The file is empty.
        let _ = fs::remove_file(path);
        format!("no radar answers at {radar} ({error}): check the address")
    })?;
    out.write_all(MAGIC).map_err(file)?;
    out.write_all(&[radar.is_udp().into()]).map_err(file)?;
    let (started, mut space) = (Instant::now(), vec![0; MAX_RECORD_BYTES]);
    let mut captured = Captured::default();
    while !stop() {
        match socket.read(&mut space) {
            Ok((count, _)) => {
                let bytes = &space[..count];
                write_record(&mut out, started.elapsed(), bytes).map_err(file)?;
                captured.records += 1;
                captured.bytes += count as u64;
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => sleep(POLL),
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

#[derive(Debug)]
pub struct Capture {
    path: PathBuf,
    file: BufReader<File>,
    is_udp: bool,
}

impl Capture {
    /// Opens a capture; `None` if the file is something else, or a folder.
    pub fn open(path: &Path) -> Result<Option<Self>, Failure> {
        let failed = &in_file(path);
        if !path.is_file() {
            return Ok(None);
        }
        let mut file = BufReader::new(File::open(path).map_err(failed)?);
        let mut head = [0; MAGIC.len() + 1];
        let is_one = read_whole(&mut file, &mut head).map_err(failed)?;
        if !is_one || !head.starts_with(MAGIC) {
            return Ok(None);
        }
        match head[MAGIC.len()] {
            protocol @ 0..=1 => Ok(Some(Self {
                path: path.to_owned(),
                file,
                is_udp: protocol == 1,
            })),
            _ => Err(damaged(path, "its protocol is unknown")),
        }
    }

    /// Reads the next record into `bytes`, which have room for [`MAX_RECORD_BYTES`]; returns the
    /// time and the number of bytes. `None` at the end.
    pub fn next(&mut self, bytes: &mut [u8]) -> Result<Option<(Duration, usize)>, Failure> {
        let failed = &in_file(&self.path);
        let (mut time_ns, mut count) = ([0; 8], [0; 4]);
        if !read_whole(&mut self.file, &mut time_ns).map_err(failed)?
            || !read_whole(&mut self.file, &mut count).map_err(failed)?
        {
            return Ok(None);
        }
        let count = u32::from_le_bytes(count) as usize;
        let Some(bytes) = bytes.get_mut(..count) else {
            return Err(damaged(&self.path, "a record has more bytes than any has"));
        };
        let is_whole = read_whole(&mut self.file, bytes).map_err(failed)?;
        let time = Duration::from_nanos(u64::from_le_bytes(time_ns));
        if is_whole && time > MAX_TIME {
            let reason = "a record is of more than a year after the start";
            return Err(damaged(&self.path, reason));
        }
        Ok(is_whole.then_some((time, count)))
    }

    /// Reads up to the radar's first description of itself.
    pub fn configuration(mut self) -> Result<Configuration, Failure> {
        let mut bytes = vec![0; MAX_RECORD_BYTES];
        let mut parser = RadarParser::new(self.is_udp, ENCODER_COUNTS);
        while let Some((_, count)) = self.next(&mut bytes)? {
            let space = parser.space();
            let count = count.min(space.len());
            space[..count].copy_from_slice(&bytes[..count]);
            parser.filled(count);
            while let Some(event) = parser.next() {
                if let Event::Message(Message::Configuration(radar)) = event {
                    return Ok(radar);
                }
            }
        }
        Err(damaged(&self.path, "no radar describes itself in it"))
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

/// Plays a capture as its radar, until it has ended or `stop` returns true. `rate` is a factor of
/// its pace; `None`: as fast as it is read.
pub fn play(
    mut output: Output,
    mut capture: Capture,
    rate: Option<f64>,
    stop: &dyn Fn() -> bool,
) -> Result<Captured, Failure> {
    let path = &capture.path;
    if matches!(output, Output::Group { .. }) != capture.is_udp {
        let (of, advice) = match capture.is_udp {
            true => ("UDP", "give the group as --udp GROUP:PORT"),
            false => ("TCP", "leave out --udp"),
        };
        let path = path.display();
        return Err(
            format!("{path} was captured by {of}, and can only be played so: {advice}").into(),
        );
    }
    let none = || damaged(path, "it is no capture any more");
    let radar = Capture::open(path)?.ok_or_else(none)?.configuration()?;
    output.begin(&radar)?;
    let mut played = Captured::default();
    if !output.describe(&radar, stop) || !output.await_client(stop) {
        return Ok(played);
    }
    let (mut bytes, started) = (vec![0; MAX_RECORD_BYTES], Instant::now());
    while let Some((time, count)) = capture.next(&mut bytes)? {
        let due = rate.map_or(Duration::ZERO, |rate| {
            Duration::try_from_secs_f64(time.as_secs_f64() / rate).unwrap_or(time)
        });
        // At the slowest rates a record is due in centuries.
        let due = started.checked_add(due).unwrap_or(started + MAX_TIME);
        if stop() || !sleep_until(due, stop) {
            return Ok(played);
        }
        output.send(&bytes[..count]);
        played.records += 1;
        played.bytes += count as u64;
    }
    output.close();
    Ok(played)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use tempfile::NamedTempFile;

    use super::*;

    fn file(bytes: &[u8]) -> NamedTempFile {
        let file = NamedTempFile::new().unwrap();
        fs::write(&file, bytes).unwrap();
        file
    }

    fn capture() -> Vec<u8> {
        let mut bytes = [&MAGIC[..], &[0]].concat();
        write_record(&mut bytes, Duration::from_millis(3), b"one").unwrap();
        write_record(&mut bytes, Duration::from_secs(90_000), b"other").unwrap();
        bytes
    }

    fn records(path: &Path) -> Result<Vec<(Duration, Vec<u8>)>, Failure> {
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
            let file = file(&bytes[..bytes.len() - cut]);
            assert_eq!(records(file.path()).unwrap(), whole[..left], "{cut}");
        }
    }

    #[test]
    fn what_is_no_capture_is_left_or_named() {
        let other = file(b"a file that is something else");
        assert!(Capture::open(other.path()).unwrap().is_none());
        let mut large = capture();
        large.extend([0; 8]);
        large.extend(u32::MAX.to_le_bytes());
        let error = records(file(&large).path()).unwrap_err().to_string();
        assert!(error.contains("damaged"), "{error}");
        let mut late = capture();
        write_record(&mut late, Duration::from_nanos(u64::MAX), b"never").unwrap();
        let error = records(file(&late).path()).unwrap_err().to_string();
        assert!(error.contains("more than a year"), "{error}");
        let protocol = file(&[&MAGIC[..], &[7]].concat());
        assert!(Capture::open(protocol.path()).is_err());
        let nobody = file(&capture());
        let capture = Capture::open(nobody.path()).unwrap().unwrap();
        let error = capture.configuration().unwrap_err().to_string();
        assert!(error.contains("no radar describes itself"), "{error}");
    }
}
