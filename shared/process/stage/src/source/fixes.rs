//! The fixes of a live GNSS receiver: what arrives in datagrams, or comes with the radar, is
//! published on `gnss`, whatever the source.

use std::time::{Duration, Instant};

use gyre_contract::{Gnss, GnssHeader, StageId};
use gyre_geometry::samples::{GnssConfig, Sample, SensorConfig};
use gyre_transport::{
    Manifest, RunError,
    numbers::{self, Numbers},
    transport::Node,
    writer::Writer,
};

use crate::{Launch, datagrams::Receiver};

/// The file with the number of messages so far: a source that replaces a dead one continues to
/// count.
const SENT: &str = "source.fixes";
/// Fixes, or counts of unreadable lines, that are published in this time: receivers send at most 20
/// a second.
const MAX_FIXES: usize = 5000;
const OF: Duration = Duration::from_secs(10);

/// Returns the number of messages that the sources of the run have published on `gnss`.
pub fn fixes_sent(manifest: &Manifest) -> u64 {
    numbers::read(&manifest.root.join(SENT)).map_or(0, |[sent]| sent)
}

pub(crate) struct Fixes {
    /// `None`: they come with the radar.
    receiver: Option<Receiver>,
    output: Writer<Gnss>,
    sent: Numbers<1>,
    next: u64,
    /// Fixes since that time.
    since: Instant,
    count: usize,
    /// Fixes beyond that no message counts yet.
    surplus: u64,
}

impl Fixes {
    /// Opens the receiver of the section `[gnss]`; `None` if it is not live.
    pub fn open(launch: &Launch) -> Result<Option<Self>, RunError> {
        let config: GnssConfig = launch.section("gnss")?;
        if !config.is_live() {
            return Ok(None);
        }
        let receiver = config.receives().then(|| Receiver::open(&config));
        let fixes = Self::of(receiver.transpose()?, &launch.node, &launch.manifest)?;
        let topic = config.live_topic().filter(|_| !config.receives());
        let from = topic.unwrap_or(config.listen());
        match fixes.next {
            0 => tracing::info!(from, "waiting for fixes of GNSS"),
            _ => tracing::warn!("fixes of GNSS that came while there was no source are lost"),
        }
        Ok(Some(fixes))
    }

    fn of(receiver: Option<Receiver>, node: &Node, manifest: &Manifest) -> Result<Self, RunError> {
        Ok(Self {
            receiver,
            next: fixes_sent(manifest),
            sent: Numbers::open(manifest, SENT)?,
            output: Writer::open(node, manifest)?,
            since: Instant::now(),
            count: 0,
            surplus: 0,
        })
    }

    /// Publishes the datagrams that have arrived, at most one turn of them, and answers the
    /// handshakes of new readers.
    pub fn receive(&mut self) -> Result<(), RunError> {
        self.output.answer_handshakes()?;
        let (mut fixes, mut unreadable, mut lost) = (Vec::new(), 0, 0);
        if let Some(receiver) = &mut self.receiver {
            receiver.receive(|line| match parse(line) {
                Some(fix) => fixes.push(fix),
                None => unreadable += u64::from(!line.trim().is_empty()),
            })?;
            lost = receiver.newly_dropped() as u64;
        }
        fixes.into_iter().try_for_each(|fix| self.publish(fix))?;
        if unreadable > 0 {
            self.publish(GnssHeader::counts(unreadable, 0))?;
        }
        lost += std::mem::take(&mut self.surplus);
        match lost {
            0 => Ok(()),
            _ => self.send(GnssHeader::counts(0, lost)),
        }
    }

    /// Publishes a message of the receiver, unless there are too many.
    pub fn publish(&mut self, fix: GnssHeader) -> Result<(), RunError> {
        if self.since.elapsed() >= OF {
            (self.since, self.count) = (Instant::now(), 0);
        }
        self.count += 1;
        if self.count > MAX_FIXES {
            self.surplus += fix.unreadable.max(1);
            return Ok(());
        }
        if self.next == 0 {
            tracing::info!("fixes of GNSS arrive");
        }
        self.send(fix)
    }

    fn send(&mut self, mut message: GnssHeader) -> Result<(), RunError> {
        message.item.seq = self.next;
        self.next += 1;
        // In this order a death in between leaves a number without a message, which counts as lost.
        self.sent.write([self.next])?;
        self.output.publish(message, Some(StageId::RadarReplay))
    }
}

/// Parses a line of a receiver: a stamp, ns, latitude and longitude, degrees (both empty without a
/// fix), and the standard deviation, m, if the receiver knows it. `None`: it is no such line.
fn parse(line: &str) -> Option<GnssHeader> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let (stamp, position, sigma_m) = match fields[..] {
        [stamp, latitude, longitude] => (stamp, [latitude, longitude], ""),
        [stamp, latitude, longitude, sigma_m] => (stamp, [latitude, longitude], sigma_m),
        _ => return None,
    };
    let stamp_ns = stamp.parse().ok()?;
    if position == ["", ""] {
        return Some(GnssHeader::of(stamp_ns, None));
    }
    let sigma_m = if sigma_m.is_empty() { "0" } else { sigma_m };
    let [latitude, longitude] = position;
    let numbers = [latitude, longitude, sigma_m].map(str::parse);
    let [Ok(latitude), Ok(longitude), Ok(sigma_m)] = numbers else {
        return None;
    };
    let fix = Sample::fix(stamp_ns, [latitude, longitude], 0.0, sigma_m);
    Some(GnssHeader::of(stamp_ns, Some(fix)))
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use gyre_transport::{
        reader::Port,
        rig::{Run, node},
    };

    use super::*;

    #[test]
    fn a_line_is_a_fix_or_none_or_unreadable() {
        let words = |line| parse(line).map(|it| format!("{} {:?}", it.item.stamp_ns, it.fix()));
        let fix = |sigma_m| Some(Sample::fix(17, [51.75, -1.26], 0.0, sigma_m));
        for (line, expected) in [
            ("17, 51.75,-1.26 ,0.4", fix(0.4)),
            ("17,51.75,-1.26", fix(0.0)),
            ("17,51.75,-1.26,", fix(0.0)),
            ("17,,", None),
            ("17,,,3", None),
            (
                "17,nan,1,1",
                Some(Sample::fix(17, [f64::NAN, 1.0], 0.0, 1.0)),
            ),
        ] {
            assert_eq!(words(line), Some(format!("17 {expected:?}")), "{line}");
        }
        for line in [
            "17,51.75",
            "1.5,51.75,-1.26",
            "17,51.75,,1",
            "17,51.75,-1.26,0.4,5",
            "stamp_ns,latitude_deg,longitude_deg",
            "\"17",
        ] {
            assert_eq!(words(line), None, "{line}");
        }
    }

    fn send(address: &str, datagrams: &[&[u8]]) {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        for datagram in datagrams {
            socket.send_to(datagram, address).unwrap();
        }
    }

    fn received(port: &Port<Gnss>) -> Vec<(u64, String)> {
        let messages = std::iter::from_fn(|| port.receive().unwrap());
        let words = |it: &GnssHeader| (it.item.seq, gyre_contract::Header::words(it, &[]));
        messages.map(|it| words(it.header())).collect()
    }

    #[test]
    fn what_arrives_is_published_what_is_too_much_is_counted_and_the_next_source_goes_on() {
        let run = Run::begin();
        // The system gives such a port to no socket.
        let address = format!("127.0.0.2:{}", 20_000 + std::process::id() % 10_000);
        let config = GnssConfig {
            listen: address.clone(),
            ..GnssConfig::default()
        };
        let open = || {
            let receiver = Receiver::open(&config).unwrap();
            Fixes::of(Some(receiver), &node(&run.manifest), &run.manifest).unwrap()
        };
        let port = Port::open(&node(&run.manifest), &run.manifest).unwrap();
        let mut fixes = open();
        send(&address, &[b"1,2,3\n2,,\n\n", b"\xff"]);
        fixes.receive().unwrap();
        let expected = [
            "2.0000000, 3.0000000",
            "without a fix",
            "1 unreadable, 0 lost",
        ];
        let expected = expected.map(str::to_owned);
        assert_eq!(received(&port), Vec::from_iter((0..).zip(expected)));
        drop(fixes);
        let mut flooded = open();
        send(&address, &["7,2,3\n".repeat(MAX_FIXES + 8).as_bytes()]);
        flooded.receive().unwrap();
        let last = received(&port).pop();
        let number = 3 + MAX_FIXES as u64;
        assert_eq!(last, Some((number, "0 unreadable, 8 lost".to_owned())));
        assert_eq!(fixes_sent(&run.manifest), number + 1);
    }
}
