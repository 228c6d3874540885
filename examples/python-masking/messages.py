"""The wire types of Gyre that a masking stage needs: `shared/contract` as ctypes structures.

The sizes are asserted, and a test of Gyre compares every offset with the Rust types. `type_name` is what iceoryx2 compares when a
topic is opened: a build of Gyre with another version of a message is refused, not misread.

Run as a program, it prints the layouts as JSON.
"""

import ctypes
import json
from ctypes import c_double, c_float, c_int64, c_uint8, c_uint16, c_uint32, c_uint64

MAX_AZIMUTHS = 1024
STAGES = 7
MASKING = 1  # the index of the stage's hop

# Bits of Item.flags.
END, BREAK, SYNC, BASE = 1, 2, 4, 8
ALL_FLAGS = END | BREAK | SYNC | BASE

# MaskedHeader.mask
MASK_NONE, MASK_THRESHOLD = 0, 1

# A bit of ScanHeader.azimuth_flags: the azimuth was measured, not interpolated.
MEASURED = 1


class Message(ctypes.Structure):
    """A structure that iceoryx2 knows by its NAME."""

    NAME = ""

    @classmethod
    def type_name(cls) -> str:
        return cls.NAME


class Hop(Message):
    """Time stamps of one stage's work: CLOCK_MONOTONIC, ns."""

    NAME = "gyre_hop_v1"
    _fields_ = [(name, c_int64) for name in ("received_ns", "started_ns", "finished_ns", "published_ns")]


class Item(Message):
    """The scan that a message is about; every header begins with it."""

    NAME = "gyre_item_v6"
    _fields_ = [
        ("seq", c_uint64),
        ("scan", c_uint64),
        ("previous_scan", c_uint64),
        ("published", c_uint64),
        ("numbered_from", c_uint64),
        ("stamp_ns", c_int64),
        ("due_ns", c_int64),
        ("generation", c_uint32),
        ("flags", c_uint32),
        ("lost", c_uint16 * 3 * 8),
        ("hops", Hop * STAGES),
    ]


class ScanHeader(Message):
    NAME = "gyre_scan_header_v7"
    _fields_ = [
        ("item", Item),
        ("azimuths", c_uint32),
        ("bins", c_uint32),
        ("stride", c_uint32),
        ("first_byte", c_uint32),
        ("range_resolution_m", c_float),
        ("range_offset_m", c_float),
        ("clockwise", c_uint32),
        ("doppler_s", c_float),
        ("samples", c_uint32),
        ("samples_left_out", c_uint32),
        ("azimuth_stamp_ns", c_int64 * MAX_AZIMUTHS),
        ("azimuth_rad", c_float * MAX_AZIMUTHS),
        ("azimuth_flags", c_uint8 * MAX_AZIMUTHS),
    ]


class GyroTurn(Message):
    NAME = "gyre_gyro_turn_v1"
    _fields_ = [(name, c_double) for name in ("yaw_rad", "variance_rad2", "interval_s", "sweep_rate_radps")]


class WheelDistance(Message):
    NAME = "gyre_wheel_distance_v1"
    _fields_ = [(name, c_double) for name in ("distance_m", "variance_m2", "side_variance_m2", "interval_s")]


class DopplerVelocity(Message):
    NAME = "gyre_doppler_velocity_v1"
    _fields_ = [("velocity_mps", c_double * 2), ("covariance", c_double * 3), ("bearings", c_uint64)]


class MaskedHeader(Message):
    NAME = "gyre_masked_header_v9"
    _fields_ = [
        ("item", Item),
        ("n", c_uint32),
        ("rasters", c_uint32),
        ("cell_m", c_float),
        ("mask", c_uint32),
        ("twist", c_float * 3),
        ("compensated", c_uint32),
        ("points", c_uint32),
        ("azimuth_variance_rad2", c_float),
        ("gyro", GyroTurn),
        ("has_gyro", c_uint64),
        ("wheels", WheelDistance),
        ("has_wheels", c_uint64),
        ("doppler", DopplerVelocity),
        ("has_doppler", c_uint64),
    ]


class RotationEstimate(Message):
    NAME = "gyre_rotation_estimate_v1"
    _fields_ = [
        (name, c_double)
        for name in ("angle_rad", "variance_rad2", "score", "runner_up_rad", "runner_up_score")
    ]


class RefinementRecord(Message):
    NAME = "gyre_refinement_v6"
    _fields_ = [
        ("outcome", c_uint32),
        ("initial_guess", c_uint32),
        ("overlap", c_double),
        ("support", c_double),
        ("stationary", c_uint64),
        ("gyro", c_uint64),
        ("gyro_turn_rad", c_double),
        ("gyro_scale", c_double),
        ("gyro_bias_radps", c_double),
        ("gyro_bias_sigma_radps", c_double),
        ("wheels", c_uint64),
        ("wheel_distance_m", c_double),
        ("wheel_scale", c_double),
        ("wheel_scale_sigma", c_double),
        ("doppler", c_uint64),
        ("doppler_scale", c_double),
        ("doppler_scale_sigma", c_double),
    ]


class MotionEstimate(Message):
    NAME = "gyre_motion_estimate_v8"
    _fields_ = [
        ("x_m", c_double),
        ("y_m", c_double),
        ("yaw_rad", c_double),
        ("covariance", c_double * 6),
        ("drift_share", c_double),
        ("scale_sigma", c_double),
        ("interval_ns", c_int64),
        ("score", c_double),
        ("runner_up_score", c_double),
        ("rotation", RotationEstimate),
        ("searched", c_double * 3),
        ("refinement", RefinementRecord),
    ]


class MotionHeader(Message):
    NAME = "gyre_motion_header_v11"
    _fields_ = [("item", Item), ("motion", MotionEstimate)]


class PoseHeader(Message):
    NAME = "gyre_pose_header_v11"
    _fields_ = [
        ("item", Item),
        ("motion", MotionEstimate),
        ("x_m", c_double),
        ("y_m", c_double),
        ("yaw_rad", c_double),
        ("covariance", c_double * 6),
        ("accumulated_covariance", c_double * 6),
        ("trajectory_version", c_uint64),
    ]


class ByteBlock(Message):
    """An element of `scan`. Its alignment of 64 is told to iceoryx2 when the topic is opened: ctypes learns it in Python 3.13."""

    NAME = "gyre_byte_block_v1"
    _fields_ = [("bytes", c_uint8 * 64)]


class FloatBlock(Message):
    """An element of all other topics, aligned to 64 too."""

    NAME = "gyre_float_block_v1"
    _fields_ = [("values", c_float * 16)]


BLOCK_ALIGNMENT = 64
POINT_FLOATS = 5  # x_m, y_m, time_s, weight, doppler_s

SIZES = {
    Hop: 32,
    Item: 336,
    ScanHeader: 13688,
    GyroTurn: 32,
    WheelDistance: 32,
    DopplerVelocity: 48,
    MaskedHeader: 512,
    RotationEstimate: 40,
    RefinementRecord: 128,
    MotionEstimate: 304,
    MotionHeader: 640,
    PoseHeader: 768,
    ByteBlock: 64,
    FloatBlock: 64,
}
for message, size in SIZES.items():
    assert ctypes.sizeof(message) == size, f"{message.__name__}: {ctypes.sizeof(message)}, not {size} bytes"


def layouts() -> dict:
    """Returns the size of each message and the offsets of its fields, by its name."""
    return {
        message.NAME: {
            "size": ctypes.sizeof(message),
            "offsets": {name: getattr(message, name).offset for name, _ in message._fields_},
        }
        for message in SIZES
    }


if __name__ == "__main__":
    print(json.dumps(layouts(), indent=1))
