"""`gyre-odometry DATA`, `python -m gyre DATA`: the odometry of a recording from end to end."""

import argparse
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import gyre
from gyre.drive import Drive


def count(text: str) -> int:
    """A number of scans on the command line."""
    number = int(text)
    if not 0 <= number < 2**63:
        raise ValueError
    return number


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gyre-odometry", description="The odometry of a recording, from end to end.")
    parser.add_argument("data", type=Path, help="a folder of a format that Gyre knows, an MCAP file of `gyre record`, or a bag of ROS 2")
    parser.add_argument("--config", type=Path, help="a TOML file; without one the settings are found in the recording")
    parser.add_argument(
        "--set", action="append", default=[], metavar="SECTION.KEY=VALUE",
        help="override a key, as in masking.kind=none; slam.kind=graph closes loops",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("out"), help="the folder of the results (out)")
    parser.add_argument("--ground-truth", type=Path, help="a trajectory to compare with; found in the recording if it has one")
    parser.add_argument("-n", "--n-scans", type=count, metavar="N", help="register N scans instead of all")
    parser.add_argument("-j", "--jump", type=count, metavar="N", help="begin with scan N instead of the first")
    parser.add_argument("-v", "--visualize", action="store_true", help="show scans and trajectory in a window (gyre[visualize])")
    parser.add_argument("--version", action="version", version=f"gyre {gyre.__version__}")
    return parser.parse_args(given)


def overrides(sentences: Sequence[str]) -> dict[str, object]:
    """The keys of `--set`. A value is a number, true or false, or else a string."""
    return dict(map(override, sentences))


def override(sentence: str) -> tuple[str, object]:
    key, equals, text = (part.strip() for part in sentence.partition("="))
    if not equals:
        raise gyre.ConfigError(f"--set {sentence}: expected section.key=value, as in masking.kind=none")
    if text in ("true", "false"):
        return key, text == "true"
    for number in (int, float):
        try:
            return key, number(text)
        except ValueError:
            pass
    return key, text.strip("'\"")


def run(given: argparse.Namespace) -> None:
    changed = overrides(given.set)
    config = gyre.Config.read(given.config, changed) if given.config else gyre.Config.of(given.data, changed)
    if config.note:
        print(config.note)
    dataset = gyre.open(given.data, config)
    truth = given.ground_truth or gyre.find_ground_truth(given.data)
    first = dataset.first if given.jump is None else given.jump
    total = min(len(dataset) - first, len(dataset) if given.n_scans is None else given.n_scans)
    if total <= 0:
        raise gyre.ReadError(f"there is no scan to register: {given.data} has {len(dataset)}, counted from 0")
    drive = Drive(config, given.out, gyre.Trajectory.read(truth) if truth else None, given.visualize)
    try:
        for scan in progress(dataset.scans(first, total), total):
            drive.register(scan)
    finally:
        # What was registered before Ctrl-C, or before a file that cannot be read, is not lost.
        if drive.registered:
            print(drive.write())
    if not drive.registered:
        raise gyre.Error(f"no scan of {given.data} could be registered: the warnings say why")


def progress(scans: Iterator[gyre.Scan], total: int) -> Iterator[gyre.Scan]:
    """The scans, with a line of progress on a terminal."""
    began, shown = time.monotonic(), 0.0
    for number, scan in enumerate(scans, 1):
        yield scan
        now = time.monotonic()
        if sys.stderr.isatty() and (now - shown > 0.1 or number == total):
            shown, rate = now, number / max(now - began, 1e-9)
            print(f"\rscan {number} of {total}, {rate:.1f} scans/s, {(total - number) / rate:.0f} s left ", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)


def main(given: Sequence[str] | None = None) -> int:
    """Runs, and returns the exit status: 1 after an error, which is printed in a sentence."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", gyre.SkippedScanWarning)
            warnings.showwarning = lambda message, *_: print(f"\rwarning: {message}", file=sys.stderr)
            run(arguments(given))
    except (gyre.Error, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
