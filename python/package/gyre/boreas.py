"""`python -m gyre.boreas BATCH`: what the benchmarks Boreas and Boreas-RT accept, from the runs of `gyre batch`.

The odometry is from `BATCH/drives/NAME`, where NAME is the folder of the recording, as in boreas-2020-12-04-14-00. The localisation, if there is
one, is from `BATCH/localised/NAME`, which `gyre localise` writes, in the map of `BATCH/drives/REFERENCE`.
"""

import argparse
import csv
import json
import os
import re
import sys
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import gyre
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

# The drives of pyboreas 2.0.0 (pyboreas/data/splits.py), without `boreas-`. Boreas has one map,
# which is no part of the odometry; in Boreas-RT the first drive of each place is its map.
BOREAS_MAP = "2020-11-26-13-58"
BOREAS = """
    2020-12-04-14-00 2021-01-26-10-59 2021-02-09-12-55 2021-03-09-14-23 2021-04-22-15-00 2021-06-29-18-53 2021-06-29-20-43
    2021-09-08-21-00 2021-09-09-15-28 2021-10-05-15-35 2021-10-26-12-35 2021-11-06-18-55 2021-11-28-09-18
""".split()
BOREAS_ODOMETRY_ONLY = {"2021-04-22-15-00", "2021-06-29-20-43", "2021-09-09-15-28"}
BOREAS_RT = """
    2024-12-03-12-54 2025-01-08-11-22 2025-02-15-17-19
    2024-12-05-14-12 2024-12-23-16-27 2024-12-23-16-44
    2024-12-04-11-45 2024-12-04-12-08 2024-12-04-12-34
    2024-12-04-14-28 2024-12-04-14-50 2024-12-04-15-19
    2025-07-18-14-55 2025-07-18-15-30 2025-08-13-09-01
"""
PLACES = [line.split() for line in BOREAS_RT.strip().splitlines()]

# The drives whose odometry is judged. The drives whose localisation is judged, each with the
# drive of its map.
ODOMETRY = {"boreas": BOREAS, "boreasrt": sum(PLACES, [])}
LOCALISATION = {
    "boreas": {drive: BOREAS_MAP for drive in BOREAS if drive not in BOREAS_ODOMETRY_ONLY},
    "boreasrt": {drive: first for first, *others in PLACES for drive in others},
}

# The longest values of metadata.yaml.
LONGEST = {"methodname": 30, "email": 100, "author": 100, "papertitle": 150, "paperurl": 500, "venue": 10, "year": 4, "computer": 50}
# Turns a frame with y to the left and z up into the radar's, with y to the right and z down.
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
# A scan in less than this from the time in the name of its image, us.
SWEEP_US = 125_000
# No fix is farther from its keyframe in the map, m.
FARTHEST_M = 50.0
POSE = ("stamp_ns", "x_m", "y_m", "yaw_rad")
COVARIANCE = ("cov_xx", "cov_xy", "cov_xyaw", "cov_yy", "cov_yyaw", "cov_yawyaw")


def matrix(x_m: float, y_m: float, yaw_rad: float) -> Matrix:
    """A pose in the plane as a 4 x 4 matrix, with z up."""
    pose = np.eye(4)
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    pose[:2, :2], pose[:2, 3] = [[cos, -sin], [sin, cos]], [x_m, y_m]
    return pose


def line(stamps: Iterable[int], *matrices: Matrix) -> str:
    """A line of a file: stamps, and the elements of matrices row by row."""
    values = (float(value) + 0.0 for elements in matrices for value in elements.ravel())
    return " ".join([*map(str, stamps), *map(repr, values)])


def odometry_line(stamp_us: int, pose: Matrix) -> str:
    """The fixed frame in the frame of the radar."""
    return line([stamp_us], (FLIP @ np.linalg.inv(pose) @ FLIP)[:3])


def localisation_line(stamps_us: tuple[int, int], pose: Matrix, reference: Matrix, covariance: Matrix) -> str:
    """The scan in the frame of the reference, with the inverse covariance of the error xi of T_estimated = exp(xi) T_true.

    `covariance` is that of the x, y and yaw of the pose, along the axes of the map.
    """
    relative = FLIP @ np.linalg.inv(reference) @ pose @ FLIP
    x_m, y_m = relative[:2, 3]
    turn = np.eye(3)
    turn[:2, :2] = (FLIP @ np.linalg.inv(reference))[:2, :2]
    turn[2, 2] = -1.0
    # An error of the heading turns the scan about the reference, not about itself.
    about = np.array([[1.0, 0.0, y_m], [0.0, 1.0, -x_m], [0.0, 0.0, 1.0]]) @ turn
    # Errors of z, roll and pitch are zero there.
    information = np.eye(6)
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    information[plane] = np.linalg.inv(about @ covariance @ about.T)
    return line(stamps_us, relative[:3], information)


def table(path: Path, columns: Sequence[str], remedy: str) -> dict[int, Matrix]:
    """The values of some columns by scan, with NaN where there is none."""
    try:
        with path.open(newline="") as file:
            return {int(row["scan"]): np.array([float(row[name] or "nan") for name in columns]) for row in csv.DictReader(file)}
    except OSError as error:
        raise gyre.ReadError(f"{path}: {error.strerror}; {remedy}") from error
    except (KeyError, ValueError) as error:
        raise gyre.ReadError(f"{path} is damaged, or of another version of Gyre ({error}); {remedy}") from error


def read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text())
    except OSError as error:
        raise gyre.ReadError(f"{path}: {error.strerror}; `gyre batch` writes it") from error
    except ValueError as error:
        raise gyre.ReadError(f"{path} is damaged ({error}): remove it, and the same `gyre batch` makes it again") from error
    if not isinstance(content, dict):
        raise gyre.ReadError(f"{path} is damaged: remove it, and the same `gyre batch` makes it again")
    return content


def known(values: Iterable[str]) -> str:
    """A few of many names."""
    names = list(values)
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


class Drive:
    """A complete run of a batch: its summary, and the stamps and poses of all images of the radar."""

    def __init__(self, batch: Path, name: str) -> None:
        self.name, self.folder = f"boreas-{name}", batch / "drives" / f"boreas-{name}"
        self.require_complete(read_json(batch / "rows" / f"{self.name}.json"))
        self.summary = read_json(self.folder / "summary.json")
        self.images_us = images(Path(str(self.summary.get("data"))), self.name)
        self.rows = table(self.folder / "poses.csv", POSE, "remove the folder, and run the same `gyre batch` again")
        self.require_all(self.rows, "poses.csv", "compute it without source.first and source.scans; `gyre inspect` lists what is damaged")
        if self.summary.get("breaks"):
            raise gyre.ReadError(
                f"{self.folder} has {self.summary['breaks']} gaps of more than 10 s between scans, over which no motion is known: "
                "download the missing images, and compute it again"
            )

    def require_complete(self, row: dict[str, Any]) -> None:
        outcome, reason = row.get("outcome"), row.get("sentence")
        has_results = (self.folder / "journal/complete").exists()
        if outcome not in ("complete", "unsure") or not has_results:
            reason = reason or "it is being computed again, or its results were removed"
            raise gyre.ReadError(f"{self.folder} is not complete ({outcome}: {reason}): put it right, and run the same `gyre batch` again")
        if outcome == "unsure":
            print(f"warning: {self.name} is unsure: {reason}", file=sys.stderr)

    def require_all(self, scans: dict[int, Matrix], file: str, remedy: str) -> None:
        """Fails unless there is a pose for each image, with the time in its name."""
        missing = [stamp_us for scan, stamp_us in enumerate(self.images_us) if scan not in scans or not np.isfinite(scans[scan][:10]).all()]
        if missing:
            raise gyre.ReadError(
                f"{self.name}: {file} has no pose for {len(missing)} of the {len(self.images_us)} images of the radar, the first is "
                f"{missing[0]}.png, and the benchmark needs one for each: {remedy}"
            )
        for scan, row in scans.items():
            if scan >= len(self.images_us) or abs(row[0] * 1e-3 - self.images_us[scan]) > SWEEP_US:
                raise gyre.ReadError(
                    f"{self.name}: scan {scan} of {file} is not of an image in {self.summary['data']}: the recording has changed; compute it again"
                )

    def odometry(self) -> str:
        lines = (odometry_line(stamp_us, matrix(*self.rows[scan][1:])) for scan, stamp_us in enumerate(self.images_us))
        return "\n".join(lines) + "\n"

    def corrected(self) -> dict[int, Matrix]:
        """The poses by scan in the frame of the map that `gyre map` draws of it."""
        file = self.folder / "trajectory_slam.tum"
        if not file.exists():
            raise gyre.ReadError(f"{file} does not exist: a drive that is a map is computed with --set slam.kind=graph")
        poses = [matrix(*pose) for pose in gyre.Trajectory.read(file).poses]
        if len(poses) != len(self.rows):
            raise gyre.ReadError(f"{file} has {len(poses)} poses, and poses.csv beside it {len(self.rows)}: run the same `gyre batch` again")
        first = np.linalg.inv(poses[0])
        return {scan: first @ pose for scan, pose in zip(self.rows, poses, strict=True)}

    def localisation(self, batch: Path, reference: "Drive", places: dict[int, Matrix]) -> str:
        """The scans in the frames of the nearest keyframes of the map of another drive."""
        folder = batch / "localised" / self.name
        remedy = f"`gyre localise --map MAP RECORDING --out {folder}` writes it, where MAP is of {reference.folder}"
        fixes = table(folder / "fixes.csv", (*POSE, *COVARIANCE, "correlation", "place"), remedy)
        self.require_all(fixes, "fixes.csv", "the drive was not found in the map there, and zeros would be judged as poses")
        lines = []
        for scan, stamp_us in enumerate(self.images_us):
            fix = fixes[scan]
            pose, (correlation, place) = matrix(*fix[1:4]), fix[10:]
            is_near = place in places and np.linalg.norm((pose - places[int(place)])[:2, 3]) < FARTHEST_M
            # Poses between two fixes are predicted, and have no correlation.
            if place not in places or not (is_near or np.isnan(correlation)):
                raise gyre.ReadError(
                    f"scan {scan} of {folder}/fixes.csv is not near scan {place:.0f} of {reference.folder}: localise in the map that `gyre map` "
                    "draws of this run"
                )
            covariance = np.zeros((3, 3))
            covariance[np.triu_indices(3)] = fix[4:10]
            covariance += np.triu(covariance, 1).T
            if not (np.linalg.eigvalsh(covariance) > 0).all():
                raise gyre.ReadError(f"scan {scan} of {folder}/fixes.csv has a covariance that is not positive definite: localise the drive again")
            stamps_us = (stamp_us, reference.images_us[int(place)])
            lines.append(localisation_line(stamps_us, pose, places[int(place)], covariance))
        return "\n".join(lines) + "\n"


def images(recording: Path, name: str) -> list[int]:
    """The times in the names of the images of the radar, us, in their order."""
    files = list((recording / "radar").glob("*.png")) or list(recording.glob("*.png"))
    stamps = sorted(int(file.stem) for file in files if file.stem.isdecimal())
    if not stamps:
        raise gyre.ReadError(
            f"there are no images of the radar in {recording}, the recording of {name}: their names are the times that the benchmark "
            "compares; put the recording back there"
        )
    return stamps


def require_drives(batch: Path, names: Iterable[str], what: str) -> None:
    listed = [f"boreas-{name}" for name in names]
    missing = [name for name in listed if not (batch / "rows" / f"{name}.json").is_file()]
    if missing:
        raise gyre.ReadError(
            f"{batch} lacks {len(missing)} of the {len(listed)} drives of the {what}, which needs all: {known(missing)}; add their folders to the "
            "list of `gyre batch`, which names a drive after its folder"
        )


def sensors(drives: Iterable[Drive]) -> list[str]:
    """The sensors that a benchmark knows, of those that the runs used."""
    has_gyro = False
    for drive in drives:
        for sensor in ("wheels", "heading"):
            if drive.summary.get(sensor):
                raise gyre.ReadError(
                    f"{drive.folder} used {sensor}, and the benchmark has names for camera, lidar, radar and IMU: compute it with "
                    f"--set {sensor}.kind=none"
                )
        has_gyro |= bool(drive.summary.get("gyro"))
    return ["radar", "IMU"] if has_gyro else ["radar"]


def metadata(given: argparse.Namespace, kind: str, drives: Sequence[Drive]) -> dict[str, Any]:
    """The values of metadata.yaml."""
    rates = [float(drive.summary["scans_per_s"]) for drive in drives if drive.summary.get("scans_per_s")]
    machine = drives[0].summary.get("machine", {})
    values = {
        "benchmark": kind,
        "dataset": given.benchmark,
        "methodname": given.method,
        "email": given.email,
        "2d": True,
        "author": given.author,
        "papertitle": given.paper_title,
        "paperurl": given.paper_url,
        "venue": given.venue,
        "year": given.year,
        "runtimeseconds": round(sum(1 / rate for rate in rates) / max(len(rates), 1), 5),
        "computer": f"{machine.get('cores')} cores of {machine.get('processor')}"[: LONGEST["computer"]],
        "sensors": sensors(drives),
    }
    if kind == "localization":
        values |= {"ref_sensor": ["radar"], "test_sensor": ["radar"]}
    for key, longest in LONGEST.items():
        if len(values[key]) > longest:
            raise gyre.Error(f"{key} has {len(values[key])} characters, and the benchmark accepts {longest}: {values[key]}")
    return values


def write(path: Path, values: dict[str, Any], files: dict[str, str]) -> None:
    """Writes a zip, which is there as a whole or not at all."""
    # JSON is YAML.
    yaml = "".join(f"{key}: {json.dumps(value, ensure_ascii=False)}\n" for key, value in values.items())
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}")
    with zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("metadata.yaml", yaml)
        for name, text in files.items():
            archive.writestr(f"boreas-{name}.txt", text)
    os.replace(draft, path)


def run(given: argparse.Namespace) -> None:
    if not re.fullmatch(r"[A-Za-z0-9_.-]+", given.method):
        raise gyre.Error(f"--method {given.method}: the name is part of that of a file; use letters, digits, and _ . -")
    batch, benchmark = given.batch, given.benchmark
    names, localised = ODOMETRY[benchmark], LOCALISATION[benchmark]
    require_drives(batch, names, f"odometry of {benchmark}")
    drives = {name: Drive(batch, name) for name in names}
    written = {"odometry": (list(drives.values()), {name: drive.odometry() for name, drive in drives.items()})}
    if (batch / "localised").is_dir():
        references = dict.fromkeys(localised.values())
        require_drives(batch, references, f"maps of {benchmark}")
        maps = {name: drives.get(name) or Drive(batch, name) for name in references}
        places = {name: drive.corrected() for name, drive in maps.items()}
        files = {name: drives[name].localisation(batch, maps[of], places[of]) for name, of in localised.items()}
        written["localization"] = ([drives[name] for name in localised], files)
    else:
        print(f"{batch}/localised does not exist: no localisation is written")
    complete = [(kind, metadata(given, kind, of), files) for kind, (of, files) in written.items()]
    for kind, values, files in complete:
        path = given.out / f"{benchmark}-{given.method}-{kind}.zip"
        write(path, values, files)
        print(f"{path}: {len(files)} drives, {sum(len(text.splitlines()) for text in files.values())} scans")


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m gyre.boreas", description="What the benchmarks Boreas and Boreas-RT accept, from the runs of `gyre batch`."
    )
    parser.add_argument("batch", type=Path, help="the folder of `gyre batch --out`; with localised/NAME of `gyre localise` also the localisation")
    parser.add_argument("--benchmark", choices=ODOMETRY, required=True, help="whose drives")
    parser.add_argument("--method", required=True, help="the name in the table of results")
    parser.add_argument("--email", required=True, help="the address of your account there")
    parser.add_argument("--out", type=Path, default=Path("out"), help="the folder of the files (out)")
    parser.add_argument("--author", default="", help="who has made it")
    for option in ("paper-title", "paper-url", "venue", "year"):
        parser.add_argument(f"--{option}", default="", help="of a paper about it")
    return parser.parse_args(given)


def main(given: Sequence[str] | None = None) -> int:
    """Writes the files, and returns the exit status: 1 after an error, which is printed in a sentence."""
    try:
        run(arguments(given))
    except (gyre.Error, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
