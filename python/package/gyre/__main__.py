"""`gyre-odometry DATA`, `python -m gyre DATA`: the odometry of a recording from end to end."""

import argparse
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

import gyre


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gyre-odometry", description="The odometry of a recording, from end to end.")
    parser.add_argument("data", type=Path, help="a folder of a format that Gyre knows, or an MCAP file of `gyre record`")
    parser.add_argument("--config", type=Path, help="a TOML file; without one the settings are found in the recording")
    parser.add_argument(
        "--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help="override a key, as in masking.kind=none"
    )
    parser.add_argument("--out", type=Path, default=Path("out"), help="the folder of the results (out)")
    parser.add_argument("--ground-truth", type=Path, help="a trajectory to compare with; found in the recording if it has one")
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
    trajectory = register(gyre.open(given.data, config), gyre.Odometry(config))
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "config.toml").write_text(str(config))
    trajectory.write_tum(given.out / "trajectory.tum")
    trajectory.write_kitti(given.out / "trajectory_kitti.txt")
    trajectory.plot(given.out / "trajectory.svg")
    truth = given.ground_truth or gyre.find_ground_truth(given.data)
    if truth is None:
        print("no ground truth: nothing is evaluated")
    else:
        evaluation = gyre.evaluate(trajectory, gyre.Trajectory.read(truth))
        evaluation.plot(given.out / "trajectory.svg")
        print(f"against {truth}\n{evaluation}")
    print(f"results in {given.out}: {', '.join(sorted(file.name for file in given.out.iterdir()))}")


def register(dataset: gyre.Dataset, odometry: gyre.Odometry) -> gyre.Trajectory:
    """Registers all scans, with a line of progress on a terminal."""
    began, shown, count = time.monotonic(), 0.0, 0
    for count, scan in enumerate(dataset, 1):
        try:
            odometry.register(scan)
        except gyre.ScanError as error:
            warnings.warn(f"skipped: scan {scan.index}: {error}", gyre.SkippedScanWarning, stacklevel=1)
        now = time.monotonic()
        if sys.stderr.isatty() and now - shown > 0.1:
            shown = now
            print(f"\rscan {count} of {len(dataset)}, {count / (now - began):.1f} scans/s", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    trajectory = odometry.trajectory
    seconds = time.monotonic() - began
    print(f"{len(trajectory)} of {len(dataset)} scans, {trajectory.path_m:.1f} m, {count / seconds:.1f} scans/s")
    return trajectory


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
