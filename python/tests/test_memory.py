"""Scans are not copied, and what a user does to their memory ends in a sentence."""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest
from conftest import STAMP_NS, noise, scan


def kib(name: str) -> int:
    """A figure of this process's memory, KiB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith(name)))


def peak_growth_kib(do: Callable[[], object]) -> int:
    """By how much the memory of this process grows at most while it does something, KiB."""
    Path("/proc/self/clear_refs").write_text("5")  # the peak is counted from now on
    before = kib("VmRSS")
    do()
    return kib("VmHWM") - before


def test_a_copy_of_a_scan_would_be_seen() -> None:
    power = np.ones((1000, 40_000), np.uint8)
    assert peak_growth_kib(lambda: power.copy()) > power.nbytes / 1024 * 0.9


@pytest.mark.parametrize("method", ["register", "mask"])
def test_a_scan_is_not_copied_when_it_is_made_registered_or_masked(method: str) -> None:
    power = np.zeros((1000, 40_000), np.uint8)
    power[::3, ::97] = 200
    untyped: Any = gyre.Odometry() if method == "register" else gyre.Masker()
    process = getattr(untyped, method)
    process(scan(power, range_resolution_m=0.005))  # what is kept from scan to scan is allocated here

    def again() -> None:
        process(scan(power, range_resolution_m=0.005, stamp_ns=STAMP_NS + 250_000_000))

    assert peak_growth_kib(again) < power.nbytes / 1024 / 8


def test_a_scan_is_registered_where_it_lies(tmp_path: Path) -> None:
    power, odometry = noise(), gyre.Odometry()
    mine = scan(power)
    power[:] = 0
    odometry.register(mine)
    assert mine.power is power and len(odometry.points) == 0
    noise().tofile(tmp_path / "power")
    mapped = np.memmap(tmp_path / "power", np.uint8, mode="r", shape=(400, 576))
    assert gyre.Odometry().register(scan(mapped)).outcome == "start"


@pytest.mark.parametrize(
    "array",
    [
        noise()[::-1],
        noise()[:, ::-1],
        noise()[:0],
        np.broadcast_to(np.uint8(3), (400, 576)),
        np.lib.stride_tricks.as_strided(noise(), (400, 576), (1, 1)),
    ],
    ids=["rows from last to first", "bins from last to first", "no azimuth", "one number", "rows that overlap"],
)
def test_arrays_whose_elements_are_not_one_behind_the_other_are_refused(array: Any) -> None:
    with pytest.raises((ValueError, gyre.ScanError), match=r"np\.ascontiguousarray|a scan has azimuths"):
        scan(array)


@pytest.mark.parametrize("range_resolution_m", [1e30, 1e38, float("inf"), -1.0, 1e-30])
def test_range_resolutions_of_no_radar_are_refused(range_resolution_m: float) -> None:
    with pytest.raises(gyre.ScanError, match="range resolution in metres"):
        scan(noise(), range_resolution_m=range_resolution_m)


def test_the_coarsest_and_the_smallest_scans_are_registered() -> None:
    for power, range_resolution_m in ((noise(), 1000.0), (noise(1, 1), 0.001), (noise(1024, 1), 1.0), (noise(1, 100_000), 0.001)):
        odometry = gyre.Odometry()
        for number in range(3):
            odometry.register(scan(power, range_resolution_m=range_resolution_m, stamp_ns=STAMP_NS + number * 250_000_000))
        assert np.isfinite(odometry.trajectory.poses).all()


def test_an_array_that_is_made_smaller_is_refused() -> None:
    power = noise()
    mine = scan(power)
    power.resize((2, 2), refcheck=False)
    with pytest.raises(gyre.ScanError, match="image has 4 elements"):
        gyre.Odometry().register(mine)


def test_arrays_that_another_thread_writes_to_end_in_a_result_or_a_sentence() -> None:
    mine, stop = scan(noise()), threading.Event()

    def write() -> None:
        random = np.random.default_rng(2)
        while not stop.is_set():
            mine.power[:] = random.integers(0, 255, (400, 576), dtype=np.uint8)
            mine.azimuth_rad[:] = random.choice([0.0, 1e30, np.nan, -np.inf], 400).astype(np.float32)
            mine.azimuth_stamp_ns[:] = STAMP_NS + random.integers(-(2**40), 2**40, 400)
            mine.azimuth_flags[:] = random.integers(0, 255, 400, dtype=np.uint8)

    writer = threading.Thread(target=write)
    writer.start()
    try:
        odometry, masker = gyre.Odometry(), gyre.Masker()
        for _ in range(40):
            for process in (odometry.register, masker.mask):
                try:
                    process(mine)
                except gyre.ScanError as error:
                    assert len(str(error)) > 20
    finally:
        stop.set()
        writer.join()
    assert gyre.Odometry().register(scan(noise())).outcome == "start"


def test_a_dataset_whose_folder_is_gone_says_so(recording: Path, tmp_path: Path) -> None:
    os.rename(recording, tmp_path / "moved")
    try:
        dataset = gyre.open(tmp_path / "moved")
    finally:
        os.rename(tmp_path / "moved", recording)
    with pytest.raises(gyre.ReadError, match="moved"):
        dataset[0]
    with pytest.raises(gyre.ReadError, match="moved"):
        next(iter(dataset))
