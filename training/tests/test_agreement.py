"""The search that masks are trained through is the search that Gyre runs."""

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
from gyre_training.worlds import find_gyre

WORLD = "\n[simulation]\nscans = 11\nseed = 7\n"
RASTERS = {
    "papers, Eq. 7": ("paper-127", []),
    "papers, line 14": ("paper-127", ["rotation.form=line14"]),
    "Gyre's default": ("gyre-255", []),
    # 250 = 2 5^3 is a size that Gyre's transforms pass over.
    "another size": ("paper-127", ["raster.n=250", "raster.cell_m=0.4"]),
}


def gyre() -> Path:
    """The program: what GYRE names, or what cargo has built."""
    if "GYRE" in os.environ:
        return Path(os.environ["GYRE"])
    try:
        return find_gyre(None)
    except SystemExit as missing:
        pytest.skip(f"{missing}, or in GYRE")


@pytest.mark.parametrize("name,overrides", RASTERS.values(), ids=RASTERS)
def test_hard_peaks_are_those_of_gyre(name, overrides, tmp_path):
    configuration, out = tmp_path / "world.toml", tmp_path / "pairs.npy"
    configuration.write_text((HOME / "rasters" / f"{name}.toml").read_text() + WORLD)
    sets = [argument for override in overrides for argument in ("--set", override)]
    done = subprocess.run([gyre(), "export-pairs", configuration, "--out", out, *sets], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    scans = Scans(out)
    pairs = scans.pairs(1)
    assert len(pairs) == 10
    found = motions(scans, pairs, None, ScanMatch(scans.n, scans.cell_m, search_of(scans.settings)))
    searched = scans.records["searched"][pairs[:, 1]]
    assert np.abs(searched[:, 0]).max() > 1.0, "the vehicle is to move"
    assert np.abs(found - searched)[:, :2].max() < 1e-3 * scans.cell_m
    assert np.abs(found - searched)[:, 2].max() < math.radians(1e-3)
