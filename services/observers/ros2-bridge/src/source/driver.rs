//! The topics of Navtech's driver.

use gyre_client::{RunError, clock};
use gyre_colossus::Azimuth;
use gyre_contract::GnssHeader;
use gyre_geometry::samples::{Sample, SampleKind};
use gyre_ros2_messages::{
    Definition, Ros2Message,
    messages::{RadarConfigurationMessage, RadarFftDataMessage},
    nav_msgs::Odometry,
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg, RadarFftDataMsg},
    radar::DescribedRadar,
    sensor_msgs::{Imu, NavSatFix},
};
use ros2_client::{Gid, ReadError, Subscription};

use super::Settings;
use crate::{node::Node, wakeups::Wakeups};

const NODE: &str = "gyre_source";
/// Azimuths that are kept until they are taken: ten turns. The driver keeps one turn.
const AZIMUTHS: usize = 4_000;
/// Samples of a gyro that are kept: ten seconds of 400 a second.
const SAMPLES: usize = 4_000;
/// Fixes that are kept: ten seconds of 20 a second.
const FIXES: usize = 200;
const TURNS: usize = 10;

fn names() -> [String; 3] {
    [
        RadarFftDataMsg::DEFINITION,
        RadarBScanMsg::DEFINITION,
        RadarFftDataMessage::DEFINITION,
    ]
    .map(|definition| definition.dds_name())
}

pub struct Packet {
    pub message: PacketMessage,
    pub publisher: Gid,
}

pub enum PacketMessage {
    Azimuth(RadarFftDataMsg),
    /// One azimuth of a driver before 2024.
    Bytes(RadarFftDataMessage),
    Turn(RadarBScanMsg),
}

impl PacketMessage {
    /// Returns the driver's time of receipt, or the present time without one, ns.
    pub fn arrival_ns(&self) -> i64 {
        let header = match self {
            Self::Azimuth(message) => &message.header,
            Self::Bytes(message) => &message.header,
            Self::Turn(message) => &message.b_scan_img.header,
        };
        header.stamp_or(clock::since_1970_ns())
    }

    /// Returns the only azimuth; `None` of a turn.
    pub fn azimuth(&self) -> Result<Option<Azimuth<'_>>, String> {
        match self {
            Self::Azimuth(message) => Ok(Some(message.azimuth())),
            Self::Bytes(message) => message.azimuth().map(Some),
            Self::Turn(_) => Ok(None),
        }
    }
}

/// Takes the next message of the azimuths' topic, whatever its type.
type TakePacket = Box<dyn Fn() -> Result<Option<Packet>, ReadError>>;
/// Takes the next sample of a topic.
type TakeSample = Box<dyn Fn() -> Option<Sample>>;
type SubscribeSamples = fn(&mut Node, &mut Wakeups, &str) -> Result<TakeSample, RunError>;

/// The kinds whose samples travel with the scans, and their messages.
const SAMPLED: [(SampleKind, SubscribeSamples); 2] = [
    (SampleKind::Gyro, |node, wakeups, topic| {
        samples(node, wakeups, topic, Imu::sample)
    }),
    (SampleKind::Wheels, |node, wakeups, topic| {
        samples(node, wakeups, topic, Odometry::sample)
    }),
];

pub struct Driver {
    node: Node,
    topic: String,
    dds_name: String,
    pub wakeups: Wakeups,
    configuration_dds_name: String,
    configurations: Subscription<RadarConfigurationMsg>,
    older: Subscription<RadarConfigurationMessage>,
    azimuths: Option<TakePacket>,
    /// Wakes for the samples of gyro and wheels alone: a complete scan waits for them.
    pub sample_wakeups: Wakeups,
    samples: Vec<(SampleKind, TakeSample)>,
    fixes: Option<Subscription<NavSatFix>>,
}

impl Driver {
    pub fn open(settings: &Settings) -> Result<Self, RunError> {
        let mut node = Node::new(&settings.domain, "/", NODE)?;
        let mut wakeups = Wakeups::new()?;
        let topic = settings.configuration_topic();
        let mut sample_wakeups = Wakeups::new()?;
        let (mut samples, mut fixes) = (Vec::new(), None);
        for (kind, topic) in &settings.sensors {
            if *kind == SampleKind::Gnss {
                fixes = Some(wakeups.subscribe(&mut node, topic, FIXES, true)?);
                continue;
            }
            let sampled = SAMPLED.iter().find(|(of, _)| of == kind);
            let (_, subscribe) = sampled.ok_or_else(|| unknown(*kind))?;
            samples.push((*kind, subscribe(&mut node, &mut sample_wakeups, topic)?));
        }
        Ok(Self {
            topic: settings.topic.clone(),
            dds_name: node.dds_name(&settings.topic)?,
            configuration_dds_name: node.dds_name(&topic)?,
            configurations: wakeups.subscribe(&mut node, &topic, TURNS, false)?,
            older: wakeups.subscribe(&mut node, &topic, TURNS, false)?,
            azimuths: None,
            samples,
            fixes,
            node,
            wakeups,
            sample_wakeups,
        })
    }

    /// Returns the type of the azimuths' topic on DDS; `None` while there is no publisher.
    pub fn found(&self) -> Result<Option<String>, RunError> {
        match self.node.type_of(&self.dds_name) {
            Some(found) if !names().contains(&found) => {
                let (topic, names) = (&self.topic, names().join(", "));
                Err(RunError::Input(format!(
                    "{topic} carries {found}, but Gyre reads {names}"
                )))
            }
            found => Ok(found),
        }
    }

    /// Subscribes to the azimuths once there is a publisher; returns whether there is one.
    pub fn receive(&mut self) -> Result<bool, RunError> {
        if self.azimuths.is_some() {
            return Ok(true);
        }
        let Some(found) = self.found()? else {
            return Ok(false);
        };
        let [azimuth, turn, _] = names();
        let (node, wakeups, topic) = (&mut self.node, &mut self.wakeups, &self.topic);
        self.azimuths = Some(if found == azimuth {
            packets(node, wakeups, topic, AZIMUTHS, PacketMessage::Azimuth)?
        } else if found == turn {
            packets(node, wakeups, topic, TURNS, PacketMessage::Turn)?
        } else {
            packets(node, wakeups, topic, AZIMUTHS, PacketMessage::Bytes)?
        });
        Ok(true)
    }

    /// Takes the next configuration. A reader also receives messages of the other type, and may
    /// decode them to meaningless numbers: the published type decides.
    pub fn configuration(&self) -> Result<Option<DescribedRadar>, String> {
        if let Ok(Some((message, _))) = self.configurations.take()
            && self.is_described_as(RadarConfigurationMsg::DEFINITION)
        {
            return message.configuration().map(Some);
        }
        if let Ok(Some((message, _))) = self.older.take()
            && self.is_described_as(RadarConfigurationMessage::DEFINITION)
        {
            return message.configuration().map(Some);
        }
        Ok(None)
    }

    fn is_described_as(&self, form: &Definition) -> bool {
        self.node.type_of(&self.configuration_dds_name) == Some(form.dds_name())
    }

    /// Takes the next sample of a sensor beside the radar.
    pub fn sample(&self, of: SampleKind) -> Option<Sample> {
        let (_, take) = self.samples.iter().find(|(kind, _)| *kind == of)?;
        take()
    }

    /// Takes the next message of a GNSS receiver.
    pub fn fix(&self) -> Option<GnssHeader> {
        let received_ns = clock::since_1970_ns();
        match self.fixes.as_ref()?.take() {
            Ok(taken) => {
                let (message, _) = taken?;
                let stamp_ns = message.header.stamp_or(received_ns);
                Some(GnssHeader::of(stamp_ns, message.fix(received_ns)))
            }
            Err(_) => Some(GnssHeader::counts(1, 0)),
        }
    }

    pub fn packet(&self) -> Result<Option<Packet>, ReadError> {
        self.azimuths.as_ref().map_or(Ok(None), |take| take())
    }
}

fn unknown(kind: SampleKind) -> RunError {
    let section = kind.section();
    RunError::Input(format!(
        "{section}.kind is ros2, but no message of ROS 2 has samples of this kind: use udp, or a log"
    ))
}

/// The sample of an unreadable message, or one without rates, is not a number, so that it is
/// counted.
fn samples<M: Ros2Message + Send + 'static>(
    node: &mut Node,
    wakeups: &mut Wakeups,
    topic: &str,
    sample: fn(&M, i64) -> Sample,
) -> Result<TakeSample, RunError> {
    let topic: Subscription<M> = wakeups.subscribe(node, topic, SAMPLES, true)?;
    let take = move || match topic.take() {
        Ok(taken) => taken.map(|(message, _)| sample(&message, clock::since_1970_ns())),
        Err(_) => Some(Sample {
            values: [f64::NAN; 6],
            ..Sample::default()
        }),
    };
    Ok(Box::new(take))
}

fn packets<M: Ros2Message + Send + 'static>(
    node: &mut Node,
    wakeups: &mut Wakeups,
    topic: &str,
    depth: usize,
    of: fn(M) -> PacketMessage,
) -> Result<TakePacket, RunError> {
    let topic: Subscription<M> = wakeups.subscribe(node, topic, depth, false)?;
    let take = move || -> Result<Option<Packet>, ReadError> {
        let taken = topic.take()?;
        Ok(taken.map(|(message, info)| Packet {
            message: of(message),
            publisher: info.publisher_gid(),
        }))
    };
    Ok(Box::new(take))
}
