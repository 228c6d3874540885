"""Messages of ROS 2 for Cyclone DDS, and how its topics are kept: what of ROS 2 the tests need, without ROS 2."""

import os
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int8, int32, sequence, uint8, uint16, uint32, uint64
from cyclonedds.topic import Topic
from cyclonedds.util import duration

# Gyre looks for peers of its own computer at the ports of the first participants, since the loopback need not have multicast.
LOOPBACK = """<CycloneDDS><Domain>
  <General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>
  <Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time
    frame_id: str = ""


@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class NavSatStatus(IdlStruct, typename="sensor_msgs.msg.dds_.NavSatStatus_"):
    status: int8
    service: uint16


@dataclass
class NavSatFix(IdlStruct, typename="sensor_msgs.msg.dds_.NavSatFix_"):
    header: Header
    status: NavSatStatus
    latitude: float64
    longitude: float64
    altitude: float64
    position_covariance: array[float64, 9]
    position_covariance_type: uint8


@dataclass
class Odometry(IdlStruct, typename="nav_msgs.msg.dds_.Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class Imu(IdlStruct, typename="sensor_msgs.msg.dds_.Imu_"):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class Transform(IdlStruct, typename="geometry_msgs.msg.dds_.Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs.msg.dds_.TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs.msg.dds_.TFMessage_"):
    transforms: sequence[TransformStamped]


@dataclass
class ObjectHypothesis(IdlStruct, typename="vision_msgs.msg.dds_.ObjectHypothesis_"):
    class_id: str
    score: float64


@dataclass
class ObjectHypothesisWithPose(IdlStruct, typename="vision_msgs.msg.dds_.ObjectHypothesisWithPose_"):
    hypothesis: ObjectHypothesis
    pose: PoseWithCovariance


@dataclass
class BoundingBox3D(IdlStruct, typename="vision_msgs.msg.dds_.BoundingBox3D_"):
    center: Pose
    size: Vector3


@dataclass
class Detection3D(IdlStruct, typename="vision_msgs.msg.dds_.Detection3D_"):
    header: Header
    results: sequence[ObjectHypothesisWithPose]
    bbox: BoundingBox3D
    id: str


@dataclass
class Detection3DArray(IdlStruct, typename="vision_msgs.msg.dds_.Detection3DArray_"):
    header: Header
    detections: sequence[Detection3D]


@dataclass
class RadarFftDataMsg(IdlStruct, typename="navtech_msgs.msg.dds_.RadarFftDataMsg_"):
    header: Header
    angle: float64
    azimuth: uint16
    sweep_counter: uint16
    ntp_seconds: uint32
    ntp_split_seconds: uint32
    data: sequence[uint8]
    data_length: uint16


@dataclass
class RadarConfigurationMsg(IdlStruct, typename="navtech_msgs.msg.dds_.RadarConfigurationMsg_"):
    header: Header
    azimuth_samples: uint16
    encoder_size: uint16
    azimuth_offset: uint16
    bin_size: float32
    range_in_bins: uint16
    expected_rotation_rate: uint16
    range_gain: float32
    range_offset: float32


@dataclass
class Image(IdlStruct, typename="sensor_msgs.msg.dds_.Image_"):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@dataclass
class RadarBScanMsg(IdlStruct, typename="navtech_msgs.msg.dds_.RadarBScanMsg_"):
    b_scan_img: Image
    encoder_values: sequence[uint16]
    timestamps: sequence[uint64]


@dataclass
class RadarFftDataMessage(IdlStruct, typename="messages.msg.dds_.RadarFftDataMessage_"):
    header: Header
    angle: sequence[uint8]
    azimuth: sequence[uint8]
    sweep_counter: sequence[uint8]
    ntp_seconds: sequence[uint8]
    ntp_split_seconds: sequence[uint8]
    data: sequence[uint8]
    data_length: sequence[uint8]


@dataclass
class RadarConfigurationMessage(IdlStruct, typename="messages.msg.dds_.RadarConfigurationMessage_"):
    header: Header
    azimuth_samples: sequence[uint8]
    encoder_size: sequence[uint8]
    bin_size: sequence[uint8]
    range_in_bins: sequence[uint8]
    expected_rotation_rate: sequence[uint8]


def join(domain):
    """Returns a participant on the loopback alone, and what must live as long as it."""
    os.environ.pop("CYCLONEDDS_URI", None)
    kept = Domain(domain, LOOPBACK)
    return DomainParticipant(domain), kept


def qos(depth=100, latched=False):
    """Reliable, as ROS 2 asks for it."""
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=10)),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def best_effort(depth=100):
    """As drivers of sensors publish."""
    return Qos(
        Policy.Reliability.BestEffort,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def topic(participant, name, kind, **kept):
    """Opens a topic by its name in ROS 2."""
    return Topic(participant, "rt/" + name.lstrip("/"), kind, qos=qos(**kept))
