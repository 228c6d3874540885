"""The wire types of Gyre as ctypes structures, made of `messages.json`, which `gyre schema --messages` prints.

`type_name` is what iceoryx2 compares when a topic is opened: a build of Gyre with another version of a message is refused, not misread.
"""

import ctypes
import json
from pathlib import Path

_LAYOUT = json.loads(Path(__file__).with_name("messages.json").read_text())
_NUMBERS = {
    "u8": ctypes.c_uint8,
    "u16": ctypes.c_uint16,
    "u32": ctypes.c_uint32,
    "u64": ctypes.c_uint64,
    "i64": ctypes.c_int64,
    "f32": ctypes.c_float,
    "f64": ctypes.c_double,
}


class Message(ctypes.Structure):
    """A structure that iceoryx2 knows by its NAME."""

    NAME = ""

    @classmethod
    def type_name(cls) -> str:
        return cls.NAME


def _structure(layout: dict) -> type:
    fields = []
    for field in layout["fields"]:
        kind = _NUMBERS.get(field["kind"]) or STRUCTURES[field["kind"]]
        for length in reversed(field["shape"]):
            kind = kind * length
        fields.append((field["name"], kind))
    made = type(layout["name"], (Message,), {"NAME": layout["type_name"], "__doc__": layout["doc"], "_fields_": fields})
    offsets = [getattr(made, field["name"]).offset for field in layout["fields"]]
    assert offsets == [field["offset"] for field in layout["fields"]] and ctypes.sizeof(made) == layout["bytes"], layout["name"]
    return made


# Each structure comes behind those that it consists of.
STRUCTURES: dict[str, type] = {}
for _layout in _LAYOUT["structures"]:
    STRUCTURES[_layout["name"]] = _structure(_layout)

Item = STRUCTURES["Item"]
ScanHeader = STRUCTURES["ScanHeader"]
MaskedHeader = STRUCTURES["MaskedHeader"]
MotionHeader = STRUCTURES["MotionHeader"]
PoseHeader = STRUCTURES["PoseHeader"]

STAGES = len(_LAYOUT["stages"])
MASKING = _LAYOUT["stages"].index("masking")  # the index of the stage's hop

# Bits of Item.flags.
_FLAGS = dict(_LAYOUT["flags"])
END, BREAK, SYNC, BASE = (_FLAGS[name] for name in ("END", "BREAK", "SYNC", "BASE"))
ALL_FLAGS = END | BREAK | SYNC | BASE

MAX_AZIMUTHS = ScanHeader.azimuth_rad.size // 4

# MaskedHeader.mask
MASK_NONE, MASK_THRESHOLD = 0, 1

# A bit of ScanHeader.azimuth_flags: the azimuth was measured, not interpolated.
MEASURED = 1


class ByteBlock(Message):
    """An element of `scan`. Its alignment of 64 is told to iceoryx2 when the topic is opened: ctypes learns it in Python 3.13."""

    NAME = "gyre_byte_block_v1"
    _fields_ = [("bytes", ctypes.c_uint8 * 64)]


class FloatBlock(Message):
    """An element of all other topics, aligned to 64 too."""

    NAME = "gyre_float_block_v1"
    _fields_ = [("values", ctypes.c_float * 16)]


BLOCK_ALIGNMENT = 64
POINT_FLOATS = 5  # x_m, y_m, time_s, weight, doppler_s
