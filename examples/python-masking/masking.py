"""A masking stage in Python: from `scan` to `masked`, with the motions of earlier scans for motion compensation.

It does what Gyre's own threshold mask does, in numpy: powers above a floor, averaged over the depth of a cell, sampled at the cells
of a Cartesian raster as seen at the scan's stamp, and the sparse points of the scan. `gyre_stage.py` joins the run, `messages.py` has
the wire types.

    gyre run configs/demo.toml --fresh --set masking.kind='"threshold"' \\
        --set 'stages.masking.command=["python3", "examples/python-masking/masking.py"]'
"""

import math
from typing import Optional

import numpy as np

from gyre_stage import (
    Malformed,
    Port,
    Reader,
    Received,
    Run,
    Unsupported,
    Waiter,
    Writer,
    check_motion,
    check_pose,
    check_scan,
    main,
    now_ns,
)
from live import NewestScans
from messages import (
    BASE,
    BREAK,
    END,
    MASK_NONE,
    MASK_THRESHOLD,
    MASKING,
    MEASURED,
    POINT_FLOATS,
    SYNC,
    ByteBlock,
    FloatBlock,
    Item,
    MaskedHeader,
    MotionHeader,
    PoseHeader,
    ScanHeader,
)

TAU = 2.0 * math.pi
# The sensor's place depends on the time of a measurement, and that on the bearing from there: after two steps the error is
# centimetres for a cell 12 m away at 30 m/s.
FIXED_POINT_STEPS = 2
# Power above the floor at which the weight of a point reaches 1.
WEIGHT_CAP = 60.0
# A larger motion within half a sweep comes from a wrong match: no compensation is better.
MAX_TURN_RAD, MAX_TRAVEL_M = 2.0, 1e4

Twist = tuple[float, float, float]
"""A constant velocity: vx (m/s), vy (m/s), yaw rate (rad/s)."""


class Sweep:
    """A scan as arrays: rows are azimuths in the order of their measurement."""

    def __init__(self, received: Received) -> None:
        header: ScanHeader = received.header
        rows = header.azimuths
        self.resolution_m = header.range_resolution_m
        self.offset_m = header.range_offset_m
        self.side = -1.0 if header.clockwise == 1 else 1.0
        self.azimuth_rad = np.frombuffer(header.azimuth_rad, np.float32, rows).astype(np.float64)
        stamps = np.frombuffer(header.azimuth_stamp_ns, np.int64, rows)
        self.time_s = (stamps - header.item.stamp_ns).astype(np.float64) * 1e-9
        self.measured = (np.frombuffer(header.azimuth_flags, np.uint8, rows) & MEASURED) != 0
        self.doppler_s = header.doppler_s
        self.chirps = np.frombuffer(header.azimuth_flags, np.uint8, rows) & 6
        first = received.bytes()[header.first_byte :]
        # A view of the publisher's memory: rows keep the bytes that a file has between them.
        self.power = np.lib.stride_tricks.as_strided(
            first, shape=(rows, header.bins), strides=(header.stride, 1), writeable=False
        )

    def row_doppler_s(self) -> np.ndarray:
        """Returns the Doppler coefficient of each azimuth, signed by its chirp where that is known (bits 4: known, 2: rising)."""
        signed = np.where(self.chirps == 6, abs(self.doppler_s), self.doppler_s)
        return np.where(self.chirps == 4, -abs(self.doppler_s), signed)


class Rasteriser:
    """Samples sweeps at the cells of a raster: row 0 is far ahead, column 0 far left, the sensor is in the middle."""

    def __init__(self, raster: dict) -> None:
        self.n, self.cell_m = raster["n"], raster["cell_m"]
        self.min_range_m = raster["min_range_m"]
        averages = raster["sampling"] == "averaged"
        self.window_m = self.cell_m if averages else 0.0
        offset_m = (0.5 * (self.n - 1) - np.arange(self.n)) * self.cell_m
        self.x_m, self.y_m = np.meshgrid(offset_m, offset_m, indexing="ij")
        self.max_range_m = 0.5 * (self.n - 1) * self.cell_m * math.sqrt(2.0)

    def rasterise(self, sweep: Sweep, floor: int, twist: Optional[Twist]) -> np.ndarray:
        """Returns n x n powers above the floor. With a twist the raster shows the scene as seen at the scan's stamp."""
        bearings, rows, times = self._bearings(sweep)
        x, z = self.x_m, sweep.side * self.y_m  # z points towards increasing azimuths
        for _ in range(FIXED_POINT_STEPS if twist else 0):
            turns = (np.arctan2(z, x) / TAU - bearings[0]) % 1.0
            time_s = np.interp(turns, bearings[1], times)
            x, z = _in_sensor(self.x_m, sweep.side * self.y_m, twist, sweep.side, time_s)
        turns = (np.arctan2(z, x) / TAU - bearings[0]) % 1.0
        row = np.interp(turns, bearings[1], rows)
        return self._sample(sweep, floor, row, np.hypot(x, z)).astype(np.float32)

    def _bearings(self, sweep: Sweep) -> tuple:
        """Returns the start and the bearings of the azimuths from there, turns, ending with 1, and their numbers and times."""
        start = (sweep.azimuth_rad[0] / TAU) % 1.0
        steps = np.diff(sweep.azimuth_rad, prepend=sweep.azimuth_rad[0]) / TAU
        # An encoder may step back a little.
        unwrapped = np.cumsum((steps + 0.1) % 1.0 - 0.1)
        bearings = np.append(np.minimum(np.maximum.accumulate(np.maximum(unwrapped, 0.0)), 1.0), 1.0)
        rows = np.arange(len(bearings), dtype=np.float64)
        # Past the last azimuth the time stays: the first was measured a sweep earlier.
        return (start, bearings), rows, np.append(sweep.time_s, sweep.time_s[-1])

    def _sample(self, sweep: Sweep, floor: int, row: np.ndarray, range_m: np.ndarray) -> np.ndarray:
        """Returns the mean power over the depth of a cell around each range, linear between two azimuths."""
        reach = max(self.window_m, sweep.resolution_m)
        last_m = float(range_m.max()) + reach
        bins = min(sweep.power.shape[1], max(1, math.ceil((last_m - sweep.offset_m) / sweep.resolution_m) + 2))
        above = np.maximum(sweep.power[:, :bins].astype(np.int32) - floor, 0)
        # Sums up to each edge between bins: the mean over any part of a row is a difference of two of them.
        sums = np.zeros((above.shape[0] + 1, bins + 1))
        np.cumsum(above, axis=1, out=sums[:-1, 1:])
        sums[-1] = sums[0]  # past the last azimuth comes the first again
        upper = np.minimum(row.astype(np.int64), above.shape[0] - 1)
        share = row - upper
        near, far = ((range_m + half - sweep.offset_m) / sweep.resolution_m for half in (-0.5 * reach, 0.5 * reach))
        means = [(_at(sums, r, far) - _at(sums, r, near)) / (reach / sweep.resolution_m) for r in (upper, upper + 1)]
        power = means[0] + share * (means[1] - means[0])
        return np.where(range_m < self.min_range_m, 0.0, power)


def _at(sums: np.ndarray, row: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Returns the sum up to a fractional edge of a row."""
    edge = np.clip(edge, 0.0, sums.shape[1] - 1)
    left = np.minimum(edge.astype(np.int64), sums.shape[1] - 2)
    below = sums[row, left]
    return below + (edge - left) * (sums[row, left + 1] - below)


def _in_sensor(x: np.ndarray, z: np.ndarray, twist: Twist, side: float, t_s: np.ndarray) -> tuple:
    """Returns points of the frame at the scan's stamp in the sensor's frame t_s later: exp(twist t)^-1 p."""
    vx, vz, yaw_rate = twist[0], side * twist[1], side * twist[2]
    half = 0.5 * yaw_rate * t_s
    cos, sin, chord_s = np.cos(half), np.sin(half), t_s * np.sinc(half / math.pi)
    x, z = cos * x + sin * z - vx * chord_s, cos * z - sin * x - vz * chord_s
    return cos * x + sin * z, cos * z - sin * x


def twist_of(motion) -> Optional[Twist]:
    """Returns the constant velocity of a motion as searched: the logarithm over its time. Refinement leaves that motion alone, so it
    is the same whether it comes from `motion` or from `pose`."""
    x_m, y_m, yaw_rad = motion.searched
    dt_s = motion.interval_ns * 1e-9
    if dt_s == 0.0:
        return None
    half = 0.5 * yaw_rad
    stretch = 1.0 / (np.sinc(half / math.pi) * dt_s)
    cos, sin = math.cos(half), math.sin(half)
    return ((cos * x_m + sin * y_m) * stretch, (cos * y_m - sin * x_m) * stretch, yaw_rad / dt_s)


def is_plausible(twist: Twist, sweep: Sweep) -> bool:
    """Returns whether a motion is one of a vehicle within a sweep."""
    longest_s = float(np.abs(sweep.time_s).max())
    turn_rad, travel_m = abs(twist[2]) * longest_s, math.hypot(twist[0], twist[1]) * longest_s
    return turn_rad <= MAX_TURN_RAD and travel_m <= MAX_TRAVEL_M


class PointExtractor:
    """Finds sparse points: range cells above the floor that no azimuth within the beam exceeds, the strongest of them."""

    def __init__(self, points: dict) -> None:
        self.config = points

    def extract(self, sweep: Sweep, floor: int) -> np.ndarray:
        """Returns the points, one a row: x (m), y (m), time (s), weight, Doppler coefficient (s), by azimuth and then by range."""
        powers, skipped, per_cell = self._cells(sweep, floor)
        if powers.size == 0 or self.config["capacity"] == 0:
            return np.zeros((0, POINT_FLOATS), np.float32)
        peaks = np.where(powers >= self._strongest_nearby(sweep, powers), powers, 0)
        row, cell = np.nonzero(self._strongest(peaks))
        range_m = (skipped + cell + 0.5) * per_cell * sweep.resolution_m + sweep.offset_m
        angle = sweep.azimuth_rad[row]
        weight = np.minimum(peaks[row, cell] / (WEIGHT_CAP * per_cell), 1.0)
        columns = (
            range_m * np.cos(angle),
            range_m * sweep.side * np.sin(angle),
            sweep.time_s[row],
            weight,
            sweep.row_doppler_s()[row],
        )
        return np.stack(columns, axis=1).astype(np.float32)

    def _cells(self, sweep: Sweep, floor: int) -> tuple:
        """Returns the sums of the bins of each range cell above the floor, the cells left out before them, and the bins per cell."""
        per_cell = max(1, min(128, round(self.config["range_cell_m"] / sweep.resolution_m)))
        cell_m = per_cell * sweep.resolution_m

        def place(range_m: float) -> float:
            return (range_m - sweep.offset_m) / cell_m - 0.5

        skipped = max(0, math.ceil(place(self.config["min_range_m"])))
        end = max(0, math.floor(place(self.config["max_range_m"]) + 1.0))
        end = max(skipped, min(end, sweep.power.shape[1] // per_cell))
        bins = sweep.power[:, skipped * per_cell : end * per_cell].astype(np.int32)
        sums = bins.reshape(len(bins), end - skipped, per_cell).sum(axis=2)
        powers = np.maximum(sums - floor * per_cell, 0)
        powers[~sweep.measured] = 0
        return powers, skipped, per_cell

    def _strongest_nearby(self, sweep: Sweep, powers: np.ndarray) -> np.ndarray:
        """Returns the largest power at the same range in the azimuths within the beam."""
        rows = len(powers)
        reach_rad = math.radians(self.config["beam_deg"]) + 0.5 * TAU / rows
        strongest = powers.copy()
        for step in range(1, rows // 2 + 1):
            other = np.roll(np.arange(rows), -step)
            apart = np.abs((sweep.azimuth_rad[other] - sweep.azimuth_rad + math.pi) % TAU - math.pi)
            near = (apart <= reach_rad)[:, None]
            if not near.any():
                break
            later = np.where(near, powers[other], 0)
            np.maximum(strongest, later, out=strongest)
            # The same pairs the other way round.
            strongest[other] = np.maximum(strongest[other], np.where(near, powers, 0))
        return strongest

    def _strongest(self, peaks: np.ndarray) -> np.ndarray:
        """Returns which peaks there is room for: of equal ones all or none."""
        capacity = self.config["capacity"]
        powers = np.sort(peaks[peaks > 0])[::-1]
        if len(powers) <= capacity:
            return peaks > 0
        return peaks > powers[capacity]


class Motions:
    """The motions for motion compensation, by number, and the newest pose."""

    KEPT = 256  # more than any window and lag need

    def __init__(self, run: Run) -> None:
        limits = run.manifest["limits"]

        def checked(check):
            return lambda header, _: check(header, limits)

        self.motions = Port(run, "motion", MotionHeader, FloatBlock, checked(check_motion))
        self.poses = Port(run, "pose", PoseHeader, FloatBlock, checked(check_pose))
        self._known: dict[int, Optional[Twist]] = {}
        self.newest_pose: Optional[int] = None
        # The item of the newest pose as its stage marks it: from then on it is known where the stream goes on.
        self.resume_at: Optional[Item] = None

    def update(self) -> None:
        """Receives new motions and poses. A motion comes twice, and both are equal."""
        while (received := self.motions.receive()) is not None:
            self._note(received)
            received.release()
        while (received := self.poses.receive()) is not None:
            item = received.item
            if not item.flags & (END | BASE):
                self._note(received)
                self.newest_pose = max(item.seq, self.newest_pose if self.newest_pose is not None else item.seq)
            if item.flags & SYNC:
                self.resume_at = item
            received.release()

    def _note(self, received: Received) -> None:
        item = received.item
        if not item.flags & END:
            # Where the chain starts there is no motion.
            self.note(item.seq, None if item.flags & BREAK else twist_of(received.header.motion))

    def note(self, seq: int, twist: Optional[Twist]) -> None:
        self._known.setdefault(seq, twist)
        if len(self._known) > self.KEPT:
            del self._known[min(self._known)]

    def before(self, seq: int, lag: int) -> tuple[bool, Optional[Twist]]:
        """Returns whether the motion for an item is known, and the motion: that of `lag` items before, None where the chain starts
        there or later."""
        first = seq - lag
        if first < 0 or any(self._known.get(k, 0) is None for k in range(first + 1, seq + 1)):
            return True, None
        return first in self._known, self._known.get(first)


class Masking:
    """The stage: takes scans, each with its motion, and publishes their masks."""

    def __init__(self, run: Run) -> None:
        manifest, configuration = run.manifest, run.configuration
        self.window, limits = manifest["window"], manifest["limits"]
        self.masking = configuration["masking"]
        if limits["rasters"] != 1:
            raise Unsupported("this stage masks one scan at a time: choose a masking.model of one scan, or masking.kind `threshold`")
        if self.masking["undo_doppler"]:
            raise Unsupported("this stage does not compensate rasters for the Doppler shift: set masking.undo_doppler to false")
        self.floor = 0 if self.masking["kind"] == "none" else self.masking["threshold"]
        self.rasteriser = Rasteriser(configuration["raster"])
        self.points = PointExtractor(configuration["points"])
        self.signals = run.signals
        self.started = self.ended = False
        self.has_place = run.take_place()
        if not self.has_place:
            return
        self.motions = Motions(run)
        live = manifest["live"]
        self.scans = NewestScans(run, self.motions) if live else Reader(run, "scan", ScanHeader, ByteBlock, check_scan)
        cells = -(-limits["raster_cells"] // 16)
        elements = cells + -(-limits["points"] * POINT_FLOATS * 4 // 64)
        # As many messages as subscribers can hold at once; iceoryx2 would reserve a queue of its own for each of them.
        queue = 2 * self.window["scans"] + self.window["look_back"]
        readers = 3 + int(self.window["slam"])
        samples = queue + 3 * readers + self.window["observers"] + 1
        self.first_point = cells * 16
        self.writer = Writer(run, "masked", MaskedHeader, FloatBlock, elements, samples)
        self.waiter = Waiter(run, [self.scans, self.motions.motions, self.motions.poses], self.writer)

    def run(self) -> None:
        """Works until SIGTERM."""
        if not self.has_place:
            return
        self.drain()
        while self.waiter.wait():
            self.drain()

    def drain(self) -> None:
        """Processes what is there, as far as its motions are known."""
        while not self.ended and not self.signals.stopped:
            self.motions.update()
            if self.motions.resume_at is None or (scan := self.scans.head()) is None:
                return
            item = scan.item
            if item.flags & END:
                self.end(item)
            elif self.is_known_to_readers(item):
                pass
            else:
                known, twist = self.motion_for(item)
                if not known:
                    return
                self.process(scan, twist)
            self.scans.advance()

    def is_known_to_readers(self, item: Item) -> bool:
        """Returns whether a restarted stage need not send an item again."""
        newest = self.motions.newest_pose
        return not self.started and newest is not None and item.seq + self.window["look_back"] <= newest

    def motion_for(self, item: Item) -> tuple[bool, Optional[Twist]]:
        if item.flags & BREAK:
            self.motions.note(item.seq, None)
        lag = self.window["lag"]
        return self.motions.before(item.seq, lag) if lag else (True, None)

    def process(self, received: Received, twist: Optional[Twist]) -> None:
        """Masks a scan and publishes the mask."""
        self.started = True
        draft = self.writer.loan()
        started_ns = now_ns()
        sweep = Sweep(received)
        if twist is not None and not is_plausible(twist, sweep):
            twist = None
        values = draft.floats()
        n = self.rasteriser.n
        values[: n * n] = self.rasteriser.rasterise(sweep, self.floor, twist).ravel()
        points = self.points.extract(sweep, self.floor)
        values[self.first_point : self.first_point + points.size] = points.ravel()
        header = draft.header
        header.n, header.rasters, header.cell_m = n, 1, self.rasteriser.cell_m
        header.mask = MASK_NONE if self.masking["kind"] == "none" else MASK_THRESHOLD
        if twist is not None:
            header.twist[:] = twist
            header.compensated = 1
        header.points = len(points)
        item = Item.from_buffer_copy(received.item)
        hop = item.hops[MASKING]
        hop.received_ns, hop.started_ns, hop.finished_ns = received.received_ns, started_ns, now_ns()
        self.writer.send(draft, item, MASKING)

    def end(self, item: Item) -> None:
        """Passes on the end of the stream. The process lives on: its history may still be asked for."""
        self.ended = True
        self.writer.send(self.writer.loan(), Item.from_buffer_copy(item), MASKING)


if __name__ == "__main__":
    main("masking", lambda run: Masking(run).run())
