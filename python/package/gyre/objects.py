"""The moving objects of a run, from its `objects.csv`."""

import csv
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .errors import ReadError

NUMBERS = ["x_m", "y_m", "yaw_rad", "vx_m_s", "vy_m_s", "length_m", "width_m"]
COVARIANCES = ["cov_xx", "cov_xy", "cov_yy", "cov_vxvx", "cov_vxvy", "cov_vyvy"]
# The columns, with their types, and how they are read.
FIELDS: list[tuple[str, type[np.generic], Callable[[str], object]]] = [
    ("scan", np.uint64, int),
    ("stamp_ns", np.int64, int),
    ("object", np.uint64, int),
    *((name, np.float64, float) for name in NUMBERS),
    ("moving", np.bool_, lambda text: bool(int(text))),
    ("age", np.uint32, int),
    *((name, np.float64, float) for name in COVARIANCES),
]


def read_objects(run: str | os.PathLike[str]) -> npt.NDArray[np.void]:
    """Returns the moving objects of a run of `gyre run`, by the folder of its results: a structured array with a row for each object and scan.

    Its fields are the columns of `objects.csv`: places, headings and covariances in the frame of the first scan (m, rad, m/s), `moving` as bool.
    """
    path = Path(run) / "objects.csv"
    try:
        with path.open(newline="") as file:
            names, *rows = list(csv.reader(file)) or [[]]
    except OSError as error:
        raise ReadError(f"{path}: {error.strerror}; a run tracks objects with --set objects.kind=tracks") from error
    wanted = [name for name, _, _ in FIELDS]
    if names != wanted:
        raise ReadError(f"{path} has other columns than {','.join(wanted)}: it is not of this version of Gyre")
    try:
        values = [tuple(read(text) for (_, _, read), text in zip(FIELDS, row, strict=True)) for row in rows]
    except ValueError as error:
        raise ReadError(f"{path} is damaged: {error}; run it again") from error
    return np.array(values, dtype=[(name, kind) for name, kind, _ in FIELDS])
