"""The contract of a stage (docs/replace-a-stage.md) over iceoryx2's Python binding: joining a run, reading, writing, waiting.

Nothing here knows what the stage computes.
"""

import ctypes
import json
import math
import os
import select
import signal
import socket
import sys
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Iterable, NoReturn, Optional

import iceoryx2 as iox2
import numpy as np

from messages import (
    ALL_FLAGS,
    BLOCK_ALIGNMENT,
    END,
    MAX_AZIMUTHS,
    Item,
    MotionHeader,
    PoseHeader,
    ScanHeader,
)

# The transport can lose a wake-up, rarely: no wait is longer.
MAX_WAIT = iox2.Duration.from_millis(200)
# A sequence gap, a malformed message, the transport: a restart may help.
TRANSIENT = 3
# A configuration that this stage cannot do: another attempt would fail in the same way.
PERMANENT = 2


class Malformed(Exception):
    """A message that breaks its contract."""


class Unsupported(Exception):
    """A configuration that this stage cannot do."""


def now_ns() -> int:
    """Returns the clock of all stamps, CLOCK_MONOTONIC, ns."""
    return time.monotonic_ns()


def main(name: str, work: Callable[["Run"], None]) -> NoReturn:
    """Runs a stage until SIGTERM, and exits with the code that tells the supervisor whether a restart can help."""
    try:
        run = Run(name)
        work(run)
    except Unsupported as reason:
        sys.exit(_said(name, reason, PERMANENT))
    except Exception as reason:  # noqa: BLE001: whatever it is, the supervisor gets one sentence
        sys.exit(_said(name, reason, TRANSIENT))
    sys.exit(0)


def _said(name: str, reason: Exception, code: int) -> int:
    kind = "" if isinstance(reason, (Malformed, Unsupported)) else f"{type(reason).__name__}: "
    print(f"{name}: {kind}{reason}", file=sys.stderr, flush=True)
    return code


class Run:
    """The run that the environment variable GYRE_RUN names: its manifest, its configuration, and a node in its transport."""

    def __init__(self, name: str) -> None:
        root = os.environ.get("GYRE_RUN")
        if root is None:
            raise Unsupported("this is one process of a run, and GYRE_RUN is not set: start the run with `gyre run`")
        self._ready = Path(root, f"{name}.ready")
        self.manifest = json.loads(Path(root, "manifest.json").read_text())
        self.configuration = tomllib.loads(Path(root, "config.toml").read_text())
        self.signals = Signals()
        iox2.set_log_level(iox2.LogLevel.Fatal)
        # Prefix and root are the run's own, and the supervisor alone cleans up.
        transport = iox2.config.from_file(iox2.FilePath.new(f"{root}/iox.toml"))
        self.node = (
            iox2.NodeBuilder.new()
            .name(iox2.NodeName.new(name))
            .config(transport)
            .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            .create(iox2.ServiceType.Ipc)
        )

    def take_place(self) -> bool:
        """Call it when everything is loaded and the configuration is accepted, and before topics are opened. A process that is to take
        the place of another one waits here until that has ended. Returns False on SIGTERM."""
        if not os.environ.get("GYRE_STANDBY"):
            return True
        self._ready.touch()
        while not self.signals.stopped:
            readable, _, _ = select.select([sys.stdin, self.signals.wake], [], [])
            if sys.stdin in readable and not os.read(sys.stdin.fileno(), 64):
                return True
            self.signals.drain()
        return False

    def topic(self, name: str, header: type, element: type):
        """Opens a topic. It is never created here: the supervisor has given it the sizes of the window."""
        return (
            self.node.service_builder(iox2.ServiceName.new(name))
            .publish_subscribe(iox2.Slice[element])
            .user_header(header)
            .payload_alignment(iox2.Alignment.new(BLOCK_ALIGNMENT))
            .open()
        )

    def event(self, name: str):
        """Opens an event."""
        return self.node.service_builder(iox2.ServiceName.new(name)).event().open()


class Signals:
    """SIGTERM as a descriptor to wait for: a Python handler alone would not wake the wait."""

    def __init__(self) -> None:
        self.stopped = False
        self.wake, wake_end = socket.socketpair()
        self.wake.setblocking(False)
        wake_end.setblocking(False)
        self._wake_end = wake_end
        signal.set_wakeup_fd(wake_end.fileno(), warn_on_full_buffer=False)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._stop)

    def _stop(self, *_) -> None:
        self.stopped = True

    def drain(self) -> None:
        try:
            while self.wake.recv(64):
                pass
        except BlockingIOError:
            pass


@dataclass
class Received:
    """A message, borrowed from its publisher until `release`. No array of it may be used afterwards: a view of shared memory does
    not keep the message."""

    sample: object
    header: ctypes.Structure
    received_ns: int

    @property
    def item(self) -> Item:
        return self.header.item

    def bytes(self) -> np.ndarray:
        """Returns the payload, in the publisher's memory."""
        payload = self.sample.payload()
        count = payload.len() * ctypes.sizeof(payload.contained_type)
        return np.frombuffer((ctypes.c_uint8 * count).from_address(payload.as_ptr()), dtype=np.uint8)

    def release(self) -> None:
        self.sample.delete()


class Port:
    """The raw queue of a topic, with the subscribe handshake."""

    def __init__(self, run: Run, topic: str, header: type, element: type, check: Callable) -> None:
        self.topic, self._header, self._check = topic, header, check
        # In this order: then no message and no wake-up falls between.
        self._subscriber = run.topic(topic, header, element).subscriber_builder().create()
        self.listener = run.event(f"{topic}_data").listener_builder().create()
        self._handshake = run.event(f"{topic}_handshake").notifier_builder().create()
        self._handshake.notify()

    def receive(self) -> Optional[Received]:
        """Returns the next message, checked; None if there is none."""
        sample = self._subscriber.receive()
        if sample is None:
            return None
        # A copy: headers outlive their messages here.
        header = self._header.from_buffer_copy(
            ctypes.string_at(sample.user_header_ptr, ctypes.sizeof(self._header))
        )
        received = Received(sample, header, now_ns())
        item = header.item
        try:
            check_item(item)
            if not item.flags & END:
                self._check(header, received)
        except Malformed as reason:
            raise Malformed(f"topic `{self.topic}`, item {item.seq}: {reason}") from None
        return received


class Reader(Port):
    """The items of a topic in order, each once."""

    next: Optional[int] = None
    current: Optional[Received] = None

    def head(self) -> Optional[Received]:
        """Returns the current item, and receives it if necessary."""
        while self.current is None:
            received = self.receive()
            if received is None:
                break
            seq = received.item.seq
            if self.next is not None and seq > self.next:
                raise Malformed(f"topic `{self.topic}`: expected item {self.next}, but got {seq}")
            if self.next is None or seq == self.next:
                self.current = received
            else:
                received.release()  # had before
        return self.current

    def advance(self) -> None:
        """Releases the current item."""
        if self.current is not None:
            self.next = self.current.item.seq + 1
            self.current.release()
            self.current = None


class Writer:
    """The publisher of a topic."""

    def __init__(self, run: Run, topic: str, header: type, element: type, elements: int, samples: int) -> None:
        self._header, self._elements = header, elements
        self.listener = run.event(f"{topic}_handshake").listener_builder().create()
        self._data = run.event(f"{topic}_data").notifier_builder().create()
        # Last, since a publisher connects to all readers that are there. It never waits for one: the window bounds what is under way.
        self._publisher = (
            run.topic(topic, header, element)
            .publisher_builder()
            .initial_max_slice_len(elements)
            .max_loaned_samples(1)
            .override_sample_preallocation(samples)
            .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
            .create()
        )

    def loan(self) -> "Draft":
        """Returns a message to fill in."""
        return Draft(self._publisher.loan_slice_uninit(self._elements), self._header)

    def send(self, draft: "Draft", item: Item, hop: int) -> None:
        """Publishes a message about an item, and wakes the readers."""
        item.hops[hop].published_ns = now_ns()
        draft.header.item = item
        draft.sample.assume_init().send()
        self._data.notify()

    def accept_readers(self) -> None:
        """Sends the history to new readers. Readers are woken only after a handshake, or wake-ups would circulate for ever."""
        has_new = bool(self.listener.try_wait())
        self._publisher.update_connections()
        if has_new:
            self._data.notify()


class Draft:
    """A message that is being written in shared memory. Its header begins as zeros; its payload is what was there before."""

    def __init__(self, sample, header: type) -> None:
        self.sample = sample
        ctypes.memset(sample.user_header_ptr, 0, ctypes.sizeof(header))
        self.header = header.from_address(sample.user_header_ptr)

    def floats(self) -> np.ndarray:
        """Returns the payload as float32, to write."""
        payload = self.sample.payload()
        count = payload.len() * ctypes.sizeof(payload.contained_type) // 4
        return np.frombuffer((ctypes.c_float * count).from_address(payload.as_ptr()), dtype=np.float32)


class Waiter:
    """Sleeps until a publisher notifies, a reader asks for the history, or SIGTERM arrives."""

    def __init__(self, run: Run, ports: Iterable[Port], writer: Writer) -> None:
        self._signals, self._ports, self._writer = run.signals, list(ports), writer
        self._set = (
            iox2.WaitSetBuilder.new()
            .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            .create(iox2.ServiceType.Ipc)
        )
        listeners = [port.listener for port in self._ports] + [writer.listener]
        self._guards = [self._set.attach_notification(listener) for listener in listeners]
        wake = iox2.FileDescriptor.non_owning_new(self._signals.wake.fileno())
        self._guards.append(self._set.attach_notification_fd(wake))

    def wait(self) -> bool:
        """Sleeps; returns False when the stage is to exit."""
        if not self._signals.stopped:
            self._set.wait_and_process_with_timeout(MAX_WAIT)
        self._signals.drain()
        for port in self._ports:
            port.listener.try_wait()
        # After a lost handshake too: the reader finds the history at the end of its own wait.
        self._writer.accept_readers()
        return not self._signals.stopped


def require(holds: bool, reason: str) -> None:
    """Requires a condition on a message."""
    if not holds:
        raise Malformed(reason)


def check_item(item: Item) -> None:
    """Checks what holds for the item of every message."""
    require(not item.flags & ~ALL_FLAGS, f"flags is {item.flags}, but must be bits of 1 to 8")
    require(
        item.previous_scan <= item.scan,
        f"previous_scan is {item.previous_scan}, but must be at most {item.scan}, its scan",
    )


def check_scan(header: ScanHeader, received: Received) -> None:
    """Checks the geometry, the angles and the times of a scan, and the length of its payload."""
    rows = header.azimuths
    require(1 <= rows <= MAX_AZIMUTHS, f"azimuths is {rows}, but must be 1 to {MAX_AZIMUTHS}")
    payload = received.sample.payload()
    length = payload.len() * ctypes.sizeof(payload.contained_type)
    last = header.first_byte + (rows - 1) * header.stride + header.bins
    require(last <= length, f"its payload of {length} bytes is shorter than its header states: {last} bytes")
    require(rows == 1 or header.stride >= header.bins, f"stride is {header.stride}, but must be {header.bins} or more")
    require(1e-3 <= header.range_resolution_m <= 1e3, f"range_resolution_m is {header.range_resolution_m}")
    require(abs(header.range_offset_m) <= 1e4, f"range_offset_m is {header.range_offset_m}")
    require(abs(header.doppler_s) <= 1.0, f"doppler_s is {header.doppler_s}")
    angles = np.frombuffer(header.azimuth_rad, dtype=np.float32, count=rows)
    require(bool(np.isfinite(angles).all()), "an azimuth is not finite")
    stamps = np.frombuffer(header.azimuth_stamp_ns, dtype=np.int64, count=rows)
    # Floats do not overflow, and 10 s are exact enough.
    after_s = (stamps.astype(np.float64) - float(stamps[0])) * 1e-9
    require(bool((after_s >= np.maximum.accumulate(after_s) - 0.005).all()), "the times of its rows are out of order")
    require(bool((np.abs(after_s) <= 10.0).all()), "its rows are not one sweep")
    apart_s = (float(header.item.stamp_ns) - float(stamps[0])) * 1e-9
    require(abs(apart_s) <= 10.0, f"its stamp is {apart_s:.3f} s from that of its first row")


def check_motion(header, limits: dict) -> None:
    """Checks the motion of `motion` and `pose`, as far as masking depends on it and a little more."""
    motion = header.motion
    extent_m = math.isqrt(limits["raster_cells"]) * limits["cell_m"]
    planar("", (motion.x_m, motion.y_m, motion.yaw_rad), 10.0 * extent_m)
    planar("searched ", tuple(motion.searched), extent_m)
    covariance(motion.covariance)
    require(0 <= motion.interval_ns <= 10_000_000_000, f"interval_ns is {motion.interval_ns}")


def check_pose(header: PoseHeader, limits: dict) -> None:
    """Checks a pose and its motion."""
    planar("pose ", (header.x_m, header.y_m, header.yaw_rad), 1e8)
    covariance(header.covariance)
    check_motion(header, limits)


def planar(name: str, values: tuple, reach_m: float) -> None:
    x_m, y_m, yaw_rad = values
    require(abs(x_m) <= reach_m and abs(y_m) <= reach_m, f"{name}x, y are {x_m}, {y_m}, but must be within {reach_m} m")
    require(abs(yaw_rad) <= math.pi + 1e-9, f"{name}yaw is {yaw_rad}, but must be within half a turn")


def covariance(packed) -> None:
    """Checks the upper triangle of a covariance: the correlations are possible together, but for rounding."""
    xx, xy, xa, yy, ya, aa = packed
    holds = all(map(math.isfinite, packed)) and min(xx, yy, aa) >= 0.0
    if holds:
        # Without variance there must be no covariance, which the division would hide.
        holds = all(between == 0.0 for between, a, b in ((xy, xx, yy), (xa, xx, aa), (ya, yy, aa)) if a * b == 0.0)
        a, b, c = (
            between / math.sqrt(one * other) if one * other > 0.0 else 0.0
            for between, one, other in ((xy, xx, yy), (xa, xx, aa), (ya, yy, aa))
        )
        determinant = 1.0 + 2.0 * a * b * c - a * a - b * b - c * c
        holds = holds and max(abs(a), abs(b), abs(c)) <= 1.0 + 1e-6 and determinant >= -1e-6
    require(holds, f"covariance is {list(packed)}, but must be finite and positive semidefinite")
