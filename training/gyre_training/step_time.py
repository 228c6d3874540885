"""Time and memory of a training step against the batch: Weston et al., Sec. V-C and Fig. 2.

Each batch of each method runs in a process of its own, so that a peak of memory is its own; the processes of one batch take
their steps in turn, so that what else the machine does meets all of them alike. While a method is measured, up to twice the
limit of memory must be free for it: what does not fit is found by trying it.
"""

import argparse
import csv
import json
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch
from torch import nn

from .network import MaskNetwork
from .recipe import HOME
from .exhaustive import ExhaustiveMatch
from .search import ScanMatch, SearchConfig
from .train import pose_error

MIB = 1 << 20
# A raster's side in the papers, m: 127 cells of 0.8, 255 of 0.4, 511 of 0.2.
SIDE_M = 102.0
OUT_OF_MEMORY = 75


def every_shift(n: int, cell_m: float) -> SearchConfig:
    """Rasters padded to twice their size, and every shift at which they still overlap."""
    return SearchConfig(reach_m=(n - 1) * cell_m)


# mbym as the papers have it (Eq. 2), and as Gyre trains it: shifts farther than a vehicle gets are not computed.
METHODS: dict[str, Callable[[int, float], nn.Module]] = {
    "f-mbym": lambda n, cell_m: ScanMatch(n, cell_m, SearchConfig()),
    "mbym": lambda n, cell_m: ExhaustiveMatch(n, cell_m, every_shift(n, cell_m)),
    "mbym-near": lambda n, cell_m: ExhaustiveMatch(n, cell_m, SearchConfig()),
}


@dataclass(frozen=True)
class Setting:
    """What one process measures."""

    method: str
    n: int
    batch: int
    checkpoint: bool
    device: str
    threads: int


@dataclass(frozen=True)
class Measurement:
    """The median of the steps (None: not measured) and the peak of memory (None: there was not that much)."""

    method: str
    batch: int
    fits: bool
    step_s: float | None = None
    memory_mib: float | None = None


class Memory:
    """The peak of what has been taken since this was made, MiB."""

    def __init__(self, device: str):
        self.cuda = device.startswith("cuda")
        if self.cuda:
            torch.cuda.reset_peak_memory_stats()
        else:
            Path("/proc/self/clear_refs").write_text("5")  # the peak so far is forgotten
        self.before = self._peak()

    def peak(self) -> float:
        return self._peak() - self.before

    def _peak(self) -> float:
        return torch.cuda.max_memory_allocated() / MIB if self.cuda else resident("VmHWM")


def resident(which: str) -> float:
    """A line of /proc/self/status, MiB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(which)) / 1024


class Training:
    """A training of the network of Table II on noise: what is in the rasters makes no difference to a step's time."""

    def __init__(self, setting: Setting):
        torch.manual_seed(1)
        self.setting, n = setting, setting.n
        self.network = MaskNetwork().to(setting.device).train()
        self.network.checkpoint = setting.checkpoint
        self.match = METHODS[setting.method](n, SIDE_M / n).to(setting.device)
        self.optimiser = torch.optim.Adam(self.network.parameters())
        self.scans = 255 * torch.rand(2, setting.batch, n, n, device=setting.device)
        self.motion = torch.zeros(setting.batch, 3, device=setting.device)

    def step(self) -> float:
        """Seconds."""
        began = self._now()
        found = self.match(*self.network.masked(*self.scans))
        value = pose_error(found, self.motion, 1.0).sum(1).mean()  # Eq. 12
        self.optimiser.zero_grad(set_to_none=True)
        value.backward()
        self.optimiser.step()
        return self._now() - began

    def _now(self) -> float:
        if self.setting.device.startswith("cuda"):
            torch.cuda.synchronize()
        return time.perf_counter()


def serve(setting: Setting) -> None:
    """Takes a step, and says how long it took and what has been the peak of memory so far, for each line that it is given."""
    torch.set_num_threads(setting.threads)
    try:
        # A first step loads hundreds of MiB of PyTorch itself.
        Training(replace(setting, method="f-mbym", n=64, batch=1)).step()
        memory = Memory(setting.device)
        training = Training(setting)
        for _ in sys.stdin:
            print(json.dumps([training.step(), memory.peak()]), flush=True)
    except RuntimeError as error:
        # There is no class of its own for a CPU's.
        if isinstance(error, torch.OutOfMemoryError) or "memory" in str(error):
            sys.exit(OUT_OF_MEMORY)
        raise


class Worker:
    """A process that takes steps on demand."""

    def __init__(self, setting: Setting):
        self.setting = setting
        command = [sys.executable, "-m", "gyre_training.step_time", json.dumps(asdict(setting))]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        # Found from anywhere, whether the package is installed or not.
        self.process = subprocess.Popen(command, cwd=HOME, **pipes)

    def step(self) -> tuple[float, float] | None:
        """Seconds and MiB; None where there was not enough memory."""
        try:
            self.process.stdin.write("\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            pass
        line = self.process.stdout.readline()
        if line:
            return tuple(json.loads(line))
        if self.process.wait() not in (OUT_OF_MEMORY, -signal.SIGKILL):
            raise RuntimeError(f"{self.setting} ended with {self.process.returncode}")
        return None

    def close(self) -> None:
        self.process.stdout.close()
        self.process.kill()
        self.process.wait()


def compare(settings: list[Setting], steps: int, limit_mib: float) -> list[Measurement]:
    """All methods at one batch, step by step in turn, after a first step each that is not counted."""
    workers = [Worker(setting) for setting in settings]
    try:
        first = {worker: worker.step() for worker in workers}
        taking = [worker for worker, seen in first.items() if seen and seen[1] <= limit_mib]
        rounds = [{worker: worker.step() for worker in taking} for _ in range(steps)]
        return [summary(worker.setting, first[worker], [r[worker] for r in rounds if worker in r], limit_mib) for worker in workers]
    finally:
        for worker in workers:
            worker.close()


def summary(setting: Setting, first: tuple | None, later: list[tuple | None], limit_mib: float) -> Measurement:
    """A method at a batch, from its steps' seconds and MiB."""
    if first is None or None in later:
        return Measurement(setting.method, setting.batch, False)
    memory = max(mib for _, mib in [first, *later])
    step_s = statistics.median(s for s, _ in later) if later else None
    return Measurement(setting.method, setting.batch, memory <= limit_mib, step_s, round(memory, 1))


def measure(n: int, batches: list[int], limit_mib: float, steps: int, checkpoint: bool, device: str) -> Iterator[Measurement]:
    """All methods at rising batches, each until one passes the limit."""
    left = list(METHODS)
    for batch in sorted(batches):
        settings = [Setting(method, n, batch, checkpoint, device, torch.get_num_threads()) for method in left]
        for one in compare(settings, steps, limit_mib):
            yield one
            if not one.fits:
                left.remove(one.method)
        if not left:
            return


def table(measurements: list[Measurement], limit_mib: float) -> str:
    """A line for each batch with each method's time and memory; then f-mbym beside the others."""
    cells = {(one.batch, one.method): one for one in measurements}
    lines = [f"{'batch':>6}" + "".join(f"{method:>24}" for method in METHODS)]
    for batch in sorted({one.batch for one in measurements}):
        lines.append(f"{batch:>6}" + "".join(f"{cell(cells.get((batch, method))):>24}" for method in METHODS))
    beside = [against(cells, other) for other in METHODS if other != "f-mbym"]
    return "\n".join([*lines, f"within {limit_mib / 1024:g} GiB:", *beside])


def cell(one: Measurement | None) -> str:
    if one is None:
        return ""
    memory = "not enough" if one.memory_mib is None else f"{one.memory_mib:.0f} MiB"
    return f"{1e3 * one.step_s:.0f} ms {memory}" if one.fits else f"passed: {memory}"


def against(cells: dict[tuple[int, str], Measurement], other: str) -> str:
    """How many times faster and larger f-mbym is."""
    fitting = {method: {b: one for (b, m), one in cells.items() if m == method and one.fits} for method in ("f-mbym", other)}
    ours, theirs = fitting["f-mbym"], fitting[other]
    both = sorted(ours.keys() & theirs.keys())
    if not both:
        return f"  {other} fits no batch that f-mbym fits"
    times = ", ".join(f"{theirs[b].step_s / ours[b].step_s:.1f} ({b})" for b in both)
    memory = ", ".join(f"{theirs[b].memory_mib / ours[b].memory_mib:.1f} ({b})" for b in both)
    return (
        f"  f-mbym beside {other}: {max(ours) / max(theirs):g} times the batch ({max(ours)} to {max(theirs)}); "
        f"times as fast a step {times}; {other}'s memory over f-mbym's {memory}"
    )


def run(options: argparse.Namespace) -> None:
    """The command `step-time`."""
    from .plots import step_times

    limit_mib, measurements = 1024 * options.memory_gib, []
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "step_time.csv").open("w", newline="") as file:
        writer = None
        for one in measure(options.n, options.batches, limit_mib, options.steps, options.checkpoint, options.device):
            writer = writer or csv.DictWriter(file, list(asdict(one)))
            if not measurements:
                writer.writeheader()
            writer.writerow(asdict(one))
            file.flush()
            measurements.append(one)
            print(f"{one.method} at {one.batch}: {cell(one)}", flush=True)
    step_times(measurements, limit_mib, options.out / "step_time.svg")
    print(table(measurements, limit_mib))


def numbers(text: str) -> list[int]:
    return [int(one) for one in text.split(",")]


def register(commands) -> None:
    """Adds `step-time`; whether blocks are computed again, and where, are options of all commands."""
    command = commands.add_parser("step-time", help="time and memory of a training step against the batch, f-mbym beside mbym")
    command.add_argument("--n", type=int, default=255, help="cells of a raster's side")
    batches = [1 << k for k in range(11)]
    command.add_argument("--batches", type=numbers, default=batches, help="1,2,4,... by default")
    command.add_argument("--memory-gib", type=float, default=4.0, help="a batch that takes more does not fit")
    command.add_argument("--steps", type=int, default=5, help="steps of which the median is taken")
    command.add_argument("--out", type=Path, default=Path("step-time"))
    command.set_defaults(run=run)


if __name__ == "__main__":
    serve(Setting(**json.loads(sys.argv[1])))
