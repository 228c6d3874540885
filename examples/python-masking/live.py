"""The scans of a run in live mode: the newest one wins where masking takes its next.

Masking numbers the scans that it takes one after the other, so no later stage sees a gap; the gaps in the source's own count,
`published`, are the dropped scans.
"""

import os
import pathlib
from collections import deque
from typing import Optional

from gyre_stage import Port, Received, Run, check_scan
from messages import BASE, BREAK, END, ByteBlock, Item, ScanHeader

# A chain of motions breaks where the time from scan to scan is longer.
MAX_INTERVAL_NS = 10_000_000_000
# Windows of scans after which masking counts as caught up all the same: a pipeline that is slower than its scans never is.
WINDOWS_IN_ORDER = 8
# Generations that their file keeps.
KEPT = 1000


def begin_generation(out: pathlib.Path, newest: int, first: int) -> int:
    """Returns the generation that begins with item `first`: one more than those before, which a file keeps."""
    path = out / "journal" / "generation"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text().splitlines()[1 - KEPT:] if path.exists() else []
    number = max([newest] + [int(line.split()[0]) for line in lines]) + 1
    lines.append(f"{number} {first} masking")
    draft = path.with_name(".generation.tmp")
    with open(draft, "w", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
        file.writelines(line + "\n" for line in lines)
        file.flush()
        os.fsync(file.fileno())
    os.replace(draft, path)
    folder = os.open(path.parent, os.O_RDONLY)
    os.fsync(folder)
    os.close(folder)
    return number


class NewestScans(Port):
    """The queue of scans in live mode. After a start they are taken in order until masking has caught up, and as many may wait as the
    window has room for: so a restart or a swap that is shorter than that drops none of those that came meanwhile."""

    def __init__(self, run: Run, motions) -> None:
        super().__init__(run, "scan", ScanHeader, ByteBlock, check_scan)
        self._window, self._motions = run.manifest["window"]["scans"], motions
        self._queue: deque[Received] = deque()
        self._in_order = WINDOWS_IN_ORDER * self._window
        self._next: Optional[int] = None
        # The scan before, and its time; the time is unknown after a restart. None where the chain starts.
        self._previous: Optional[tuple[int, Optional[int]]] = None
        self._passed: Optional[int] = None
        # Whether the current scan has its pose already: the other stages may need its mask as their previous one.
        self._repeats = False
        self._out = pathlib.Path(run.manifest["out"])
        # Its number, and the first item number that it gives.
        self._generation = (0, 0)

    def head(self) -> Optional[Received]:
        """Returns the scan to process next, numbered; None while there is none, or the window is full."""
        while (received := self.receive()) is not None:
            self._queue.append(received)
            # A restarted source sends scans again.
            item = received.item
            if self._passed is not None and not item.flags & END and item.published <= self._passed:
                self._queue.pop().release()
            self._drop_the_oldest()
        if self._passed is not None and self._scans() <= 1:
            self._in_order = 0
        if self._next is None:
            self._resume()
            self._drop_the_oldest()
        if self._next is None or not self._queue:
            return None
        newest = self._motions.newest_pose
        is_admitted = self._next < self._window if newest is None else self._next <= newest + self._window
        if not is_admitted:
            return None
        self._number(self._queue[0].item)
        return self._queue[0]

    def advance(self) -> None:
        """Releases the current scan."""
        item = self._queue[0].item
        self._previous, self._passed = (item.scan, item.stamp_ns), item.published
        self._next += 1
        self._in_order = max(0, self._in_order - 1)
        self._repeats = False
        self._queue.popleft().release()

    def _drop_the_oldest(self) -> None:
        if self._next is None or self._repeats:
            return
        room = self._window if self._in_order else 1
        while self._scans() > room:
            self._queue.popleft().release()

    def _scans(self) -> int:
        has_end = bool(self._queue) and self._queue[-1].item.flags & END
        return len(self._queue) - (1 if has_end else 0)

    def _resume(self) -> None:
        """Goes on after the newest pose: with its scan again if the source still has it, else with a new chain."""
        pose: Item = self._motions.resume_at
        from_start = bool(pose.flags & BASE)
        while self._queue and not from_start and not self._queue[0].item.flags & END:
            if self._queue[0].item.published >= pose.published:
                break
            self._queue.popleft().release()
        if not self._queue:
            return
        front = self._queue[0].item
        first = 0 if from_start else pose.seq + 1
        self._generation = (begin_generation(self._out, pose.generation, first), first)
        if from_start:
            self._next = 0
        elif front.published == pose.published and not front.flags & END:
            self._next, self._previous, self._repeats = pose.seq, (pose.previous_scan, None), True
        else:
            self._next = first

    def _number(self, item: Item) -> None:
        """Writes the numbers of the chain into the header of a scan, which is a copy."""
        item.seq = self._next
        item.generation, item.numbered_from = self._generation
        is_end = item.flags & END
        previous = self._previous
        if previous is not None and previous[1] is not None and not is_end:
            if not 1 <= item.stamp_ns - previous[1] <= MAX_INTERVAL_NS:
                previous = None
        item.previous_scan = item.scan if previous is None else previous[0]
        item.flags = is_end | (BREAK if previous is None else 0)
