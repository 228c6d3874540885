"""Time and memory of a training step over batch size: Weston et al., Sec. V-C and Fig. 2.

Each batch of each method runs in a separate process, for a separate memory peak. The processes of one batch take turns, so
that other load on the machine affects all alike. A batch above the limit is found by trying it, so up to twice the memory
limit must be free.
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
from .results import Measurement
from .exhaustive import ExhaustiveMatch
from .search import ScanMatch, SearchConfig
from .train import pose_error

MIB = 1 << 20
# Side length of a raster in the papers, m: 127 cells of 0.8, 255 of 0.4, 511 of 0.2.
SIDE_M = 102.0
OUT_OF_MEMORY = 75


def every_shift(n: int, cell_m: float) -> SearchConfig:
    """Returns a search over every shift at which rasters overlap: padded to twice their size."""
    return SearchConfig(reach_m=(n - 1) * cell_m)


# mbym as in the papers (Eq. 2), and as Gyre trains it: only the shifts that a vehicle can make.
METHODS: dict[str, Callable[[int, float], nn.Module]] = {
    "f-mbym": lambda n, cell_m: ScanMatch(n, cell_m, SearchConfig()),
    "mbym": lambda n, cell_m: ExhaustiveMatch(n, cell_m, every_shift(n, cell_m)),
    "mbym-near": lambda n, cell_m: ExhaustiveMatch(n, cell_m, SearchConfig()),
}


@dataclass(frozen=True)
class Setting:
    """The measurement of one process."""

    method: str
    n: int
    batch: int
    checkpoint: bool
    device: str
    threads: int


class Memory:
    """The peak of the memory that was allocated since the construction, MiB."""

    def __init__(self, device: str):
        self.cuda = device.startswith("cuda")
        if self.cuda:
            torch.cuda.reset_peak_memory_stats()
        else:
            Path("/proc/self/clear_refs").write_text("5")  # resets the peak
        self.before = self._peak()

    def peak(self) -> float:
        return self._peak() - self.before

    def _peak(self) -> float:
        return torch.cuda.max_memory_allocated() / MIB if self.cuda else resident("VmHWM")


def resident(which: str) -> float:
    """Returns a value of /proc/self/status, MiB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(which)) / 1024


class Training:
    """A training of the network of Table II on noise: the time of a step does not depend on the data."""

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
        """Takes a step and returns its duration, s."""
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
    """Takes a step for each input line, and prints its duration (s) and the peak memory so far (MiB)."""
    torch.set_num_threads(setting.threads)
    try:
        # The first step loads hundreds of MiB of PyTorch.
        Training(replace(setting, method="f-mbym", n=64, batch=1)).step()
        memory = Memory(setting.device)
        training = Training(setting)
        for _ in sys.stdin:
            print(json.dumps([training.step(), memory.peak()]), flush=True)
    except RuntimeError as error:
        # On a CPU the error has no class of its own.
        if isinstance(error, torch.OutOfMemoryError) or "memory" in str(error):
            sys.exit(OUT_OF_MEMORY)
        raise


class Worker:
    """A process that takes training steps on demand."""

    def __init__(self, setting: Setting):
        self.setting = setting
        command = [sys.executable, "-m", "gyre_training.step_time", json.dumps(asdict(setting))]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        # The working directory makes the package importable if it is not installed.
        self.process = subprocess.Popen(command, cwd=HOME, **pipes)

    def step(self) -> tuple[float, float] | None:
        """Takes a step and returns its duration (s) and the peak memory (MiB), None if out of memory."""
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
    """Measures all methods at one batch size; they take turns, and the time of each first step is not counted."""
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
    """Returns the measurement of a method from the durations and peaks of its steps."""
    if first is None or None in later:
        return Measurement(setting.method, setting.batch, False)
    memory = max(mib for _, mib in [first, *later])
    fits = memory <= limit_mib
    # A later step may pass the limit that the first did not.
    step_s = statistics.median(s for s, _ in later) if later and fits else None
    return Measurement(setting.method, setting.batch, fits, step_s, round(memory, 1))


def measure(n: int, batches: list[int], limit_mib: float, steps: int, checkpoint: bool, device: str) -> Iterator[Measurement]:
    """Measures all methods at rising batch sizes, each up to the first that exceeds the limit."""
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
    """Returns a table of time and memory by batch size and method, and the ratios of the others to f-mbym."""
    cells = {(one.batch, one.method): one for one in measurements}
    lines = [f"{'batch':>6}" + "".join(f"{method:>24}" for method in METHODS)]
    for batch in sorted({one.batch for one in measurements}):
        lines.append(f"{batch:>6}" + "".join(f"{cell(cells.get((batch, method))):>24}" for method in METHODS))
    ratios = [against(cells, other) for other in METHODS if other != "f-mbym"]
    return "\n".join([*lines, f"within {limit_mib / 1024:g} GiB:", *ratios])


def cell(one: Measurement | None) -> str:
    if one is None:
        return ""
    memory = "not enough" if one.memory_mib is None else f"{one.memory_mib:.0f} MiB"
    return f"{1e3 * one.step_s:.0f} ms {memory}" if one.fits else f"passed: {memory}"


def against(cells: dict[tuple[int, str], Measurement], other: str) -> str:
    """Returns the ratios of batch size, time and memory of another method to f-mbym."""
    fitting = {method: {b: one for (b, m), one in cells.items() if m == method and one.fits} for method in ("f-mbym", other)}
    ours, theirs = fitting["f-mbym"], fitting[other]
    both = sorted(ours.keys() & theirs.keys())
    if not both:
        return f"  {other} fits no batch that f-mbym fits"
    times = ", ".join(f"{theirs[b].step_s / ours[b].step_s:.1f} ({b})" for b in both)
    memory = ", ".join(f"{theirs[b].memory_mib / ours[b].memory_mib:.1f} ({b})" for b in both)
    return (
        f"  f-mbym compared with {other}: {max(ours) / max(theirs):g} times the batch ({max(ours)} to {max(theirs)}); "
        f"step time of {other} / f-mbym {times}; memory of {other} / f-mbym {memory}"
    )


def run(options: argparse.Namespace) -> None:
    """Runs the command `step-time`."""
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
    """Adds the command `step-time`; `--checkpoint` and `--device` are options of all commands."""
    command = commands.add_parser("step-time", help="time and memory of a training step over batch size, f-mbym compared with mbym")
    command.add_argument("--n", type=int, default=255, help="cells of a side of the raster")
    batches = [1 << k for k in range(11)]
    command.add_argument("--batches", type=numbers, default=batches, help="batch sizes (default: 1,2,4,...,1024)")
    command.add_argument("--memory-gib", type=float, default=4.0, help="memory limit")
    command.add_argument("--steps", type=int, default=5, help="steps for the median")
    command.add_argument("--out", type=Path, default=Path("step-time"))
    command.set_defaults(run=run)


if __name__ == "__main__":
    serve(Setting(**json.loads(sys.argv[1])))
