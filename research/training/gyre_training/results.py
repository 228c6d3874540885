"""The figures that `compare` and `step-time` measure and `plots` draws."""

from dataclasses import dataclass

from .drift import Drift


@dataclass(frozen=True)
class Candidate:
    """A network in one number format. `pair_ms` is the time of the masks of a pair on one thread; a network of single
    scans masks only the later scan, because the earlier one has its mask already."""

    name: str
    numbers: str
    megabytes: float
    pair_ms: float
    drift: Drift


@dataclass(frozen=True)
class Measurement:
    """The median time of a step (None: not measured) and the peak memory (None: out of memory)."""

    method: str
    batch: int
    fits: bool
    step_s: float | None = None
    memory_mib: float | None = None
