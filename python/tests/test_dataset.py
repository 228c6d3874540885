"""Recordings, and what is wrong with some."""

import shutil
from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest


@pytest.fixture
def damaged(recording: Path, tmp_path: Path) -> Path:
    """A copy of the recording whose sixth scan is cut off."""
    copy = tmp_path / "damaged"
    shutil.copytree(recording, copy)
    image = gyre.open(copy).files[5]
    image.write_bytes(image.read_bytes()[:2000])
    return copy


def test_a_recording_is_a_sequence(recording: Path) -> None:
    dataset = gyre.open(recording)
    assert len(dataset) == len(list(dataset)) == len(dataset.files) == len(dataset.stamp_ns) == 24
    assert dataset.format == "oxford"
    assert dataset[-1].stamp_ns == dataset[23].stamp_ns
    assert [scan.index for scan in dataset] == list(range(24))
    assert np.all(np.diff(dataset.stamp_ns) > 0)
    assert abs(dataset[3].stamp_ns - dataset.stamp_ns[3]) < 1_000_000
    for index in (24, -25, 2**62):
        with pytest.raises(IndexError, match="the dataset has 24"):
            dataset[index]
    untyped: Any = dataset
    for wrong in (1.5, "1", None, slice(2)):
        with pytest.raises(TypeError):
            untyped[wrong]


def test_a_damaged_scan_is_skipped_with_a_warning_and_read_with_an_error(damaged: Path) -> None:
    dataset = gyre.open(damaged)
    with pytest.raises(gyre.ReadError, match=dataset.files[5].name):
        dataset[5]
    with pytest.warns(gyre.SkippedScanWarning, match=dataset.files[5].name):
        scans = [scan.index for scan in dataset]
    assert scans == [index for index in range(24) if index != 5]


def test_eleven_damaged_scans_in_a_row_end_the_iteration(damaged: Path) -> None:
    dataset = gyre.open(damaged)
    for image in dataset.files[5:16]:
        image.write_bytes(b"")
    with pytest.warns(gyre.SkippedScanWarning), pytest.raises(gyre.ReadError):
        list(dataset)


def test_a_file_that_is_gone_ends_the_iteration(damaged: Path) -> None:
    dataset = gyre.open(damaged)
    dataset.files[3].unlink()
    with pytest.raises(gyre.ReadError):
        list(dataset)


def test_a_scan_outlives_its_dataset(recording: Path) -> None:
    scan = gyre.open(recording)[2]
    assert gyre.Odometry().register(scan).outcome == "start"


def test_no_configuration_has_the_constants_of_the_one_that_is_found(radiate: Path) -> None:
    found = gyre.open(radiate, gyre.Config.of(radiate))[0]
    alone = gyre.open(radiate)[0]
    assert alone.range_offset_m == found.range_offset_m != 0
    assert alone.doppler_s == found.doppler_s != 0


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    for data in (tmp_path, tmp_path / "missing", tmp_path / "missing.mcap", "", "\0"):
        with pytest.raises((gyre.ReadError, ValueError)):
            gyre.open(data)
        with pytest.raises((gyre.ReadError, ValueError)):
            gyre.Config.of(data)
    with pytest.raises(OSError):
        gyre.inspect(tmp_path)


def test_a_report_has_its_figures(recording: Path) -> None:
    report = gyre.inspect(recording)
    assert report.to_dict()["scans"] == 24
    assert isinstance(report.findings, list)


def test_a_report_is_by_the_settings_that_are_given(recording: Path) -> None:
    alone = gyre.inspect(recording)
    config = gyre.Config({"dataset": {"range_resolution_m": 0.05}})
    report = gyre.inspect(recording, config=config)
    assert report.to_dict()["range_resolution_m"] == pytest.approx(0.05) != alone.to_dict()["range_resolution_m"]
    doubted = [any("range resolution" in finding for finding in it.findings) for it in (alone, report)]
    assert doubted == [True, False]
