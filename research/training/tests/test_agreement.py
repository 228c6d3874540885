"""The differentiable search finds the motions of Gyre's own search."""

import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gyre_training.drift import motions
from gyre_training.pairs import Scans
from gyre_training.recipe import HOME, search_of
from gyre_training.search import ScanMatch
from gyre_training.worlds import find_gyre_lab

WORLD = "\n[simulation]\nscans = 11\nseed = 7\n"
RASTERS = {
    "papers, Eq. 7": ("paper-127", []),
    "papers, line 14": ("paper-127", ["rotation.form=line14"]),
    "Gyre's default": ("gyre-255", []),
    # 250 = 2 5^3: Gyre takes another transform size.
    "another size": ("paper-127", ["raster.n=250", "raster.cell_m=0.4"]),
}


def gyre_lab() -> Path:
    """Returns the program in GYRE_LAB, else the build of this repository."""
    if "GYRE_LAB" in os.environ:
        return Path(os.environ["GYRE_LAB"])
    try:
        return find_gyre_lab(None)
    except SystemExit as missing:
        pytest.skip(f"{missing}, or set GYRE_LAB")


@pytest.mark.parametrize("name,overrides", RASTERS.values(), ids=RASTERS)
def test_motions_by_the_highest_peaks_equal_those_of_gyre(name, overrides, tmp_path):
    configuration, out = tmp_path / "world.toml", tmp_path / "pairs.npy"
    configuration.write_text((HOME / "rasters" / f"{name}.toml").read_text() + WORLD)
    sets = [argument for override in overrides for argument in ("--set", override)]
    done = subprocess.run([gyre_lab(), "export-pairs", configuration, "--out", out, *sets], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    scans = Scans(out)
    pairs = scans.pairs(1)
    assert len(pairs) == 10
    found = motions(scans, pairs, None, ScanMatch(scans.n, scans.cell_m, search_of(scans.settings)))
    searched = scans.records["searched"][pairs[:, 1]]
    assert np.abs(searched[:, 0]).max() > 1.0, "the vehicle must move"
    assert np.abs(found - searched)[:, :2].max() < 1e-3 * scans.cell_m
    assert np.abs(found - searched)[:, 2].max() < math.radians(1e-3)
