"""Scans: their memory, and what they refuse."""

import hashlib
import os
import struct
import threading
from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest
from conftest import ROOT, STAMP_NS, noise, scan


def pointer(array: Any) -> int:
    return int(array.__array_interface__["data"][0])


def test_the_array_of_a_user_is_not_copied() -> None:
    array = noise()
    mine = scan(array)
    assert mine.power is array
    assert pointer(mine.power) == pointer(array)


def test_what_is_written_to_an_array_is_registered() -> None:
    array = noise()
    mine, masker = scan(array), gyre.Masker()
    assert masker.mask(mine).raster.max() > 0
    array[:] = 0
    assert masker.mask(mine).raster.max() == 0


def test_the_powers_of_a_recording_are_a_view_without_the_bytes_between_the_rows(recording: Path) -> None:
    first = gyre.open(recording)[0]
    memory = first.power.base
    assert isinstance(memory, np.ndarray)
    assert np.shares_memory(first.power, memory)
    metadata = first.power.strides[0] - first.power.shape[1]
    assert metadata == 11, "the simulator writes the columns of Oxford"
    assert pointer(first.power) == pointer(memory) + metadata
    assert first.power is first.power


def test_rasters_and_points_are_not_copied() -> None:
    masked = gyre.Masker().mask(scan(noise()))
    assert masked.raster.flags.c_contiguous and masked.raster.dtype == np.float32
    assert not masked.points.flags.owndata
    assert masked.points.dtype.names == ("x_m", "y_m", "time_s", "weight", "doppler_s")
    ranges = np.hypot(masked.points["x_m"], masked.points["y_m"])
    assert len(ranges) > 100 and ranges.min() > 5 and ranges.max() < 81


def test_a_mask_of_two_scans_masks_the_previous_one_too() -> None:
    model = Path(__file__).parents[2] / "shared/method/masking/tests/models/pair-127.toml"
    masking = {"kind": "learned", "model": model, "backend": "rten"}
    config = gyre.Config({"masking": masking, "raster": {"n": 127, "cell_m": 0.8}})
    masker, odometry = gyre.Masker(config), gyre.Odometry(config)
    for number in range(3):
        mine = scan(noise(), stamp_ns=STAMP_NS + number * 250_000_000)
        masked = masker.mask(mine, velocity=(1.0, 0.0, 0.1))
        assert masked.previous is not None and masked.previous.shape == masked.raster.shape == (127, 127)
        assert masked.factors is not None and 0 <= masked.factors.min() <= masked.factors.max() <= 1
        assert odometry.register(mine).seq == number
    assert masker.mask(mine, velocity=(float("nan"), 0.0, 0.0)).raster.shape == (127, 127)
    with pytest.raises((TypeError, ValueError)):
        masker.mask(mine, velocity=(1.0, 0.0))


def test_the_angles_are_even_and_the_mean_time_is_that_of_the_scan() -> None:
    mine = scan(noise())
    assert np.allclose(mine.azimuth_rad, np.arange(400) * 2 * np.pi / 400, atol=1e-6)
    assert abs(int(np.mean(mine.azimuth_stamp_ns - STAMP_NS))) < 1000
    assert np.ptp(mine.azimuth_stamp_ns) == 250_000_000 * 399 // 400
    assert (mine.stamp_ns, mine.clockwise, mine.index) == (STAMP_NS, True, None)


def test_angles_of_float64_and_times_of_a_list_are_converted() -> None:
    times = [STAMP_NS + k for k in range(400)]
    mine = scan(noise(), sweep_s=None, azimuth_stamp_ns=times, azimuth_rad=np.linspace(0, 6, 400))
    assert mine.azimuth_rad.dtype == np.float32
    assert mine.azimuth_stamp_ns.tolist() == times


def test_misaligned_angles_and_times_are_converted() -> None:
    times, angles = STAMP_NS + np.arange(400), np.linspace(0, 6, 400, dtype=np.float32)
    misaligned = [np.frombuffer(b"\0" + array.tobytes(), array.dtype, offset=1) for array in (times, angles)]
    records = np.zeros(400, [("flag", "u1"), ("stamp_ns", "<i8"), ("rad", "<f4")])
    records["stamp_ns"], records["rad"] = times, angles
    for stamps, rad in (misaligned, (records["stamp_ns"], records["rad"])):
        mine = scan(noise(), sweep_s=None, azimuth_stamp_ns=stamps, azimuth_rad=rad)
        assert np.array_equal(mine.azimuth_stamp_ns, times) and np.array_equal(mine.azimuth_rad, angles)
        assert gyre.Odometry().register(mine).outcome == "start"


def test_numbers_of_scans_count_on_where_a_new_chain_starts() -> None:
    odometry = gyre.Odometry()
    ten_s = 10_000_000_000
    later_ns = [0, 250_000_000, ten_s, 3 * ten_s, 3 * ten_s + 250_000_000, ten_s]
    registered = [odometry.register(scan(noise(), stamp_ns=STAMP_NS + later)) for later in later_ns]
    assert [it.seq for it in registered] == list(range(6))
    assert [it.outcome == "start" for it in registered] == [True, False, False, True, False, True]
    with pytest.raises(gyre.ScanError):
        odometry.register(without_times())
    odometry.restart()
    again = odometry.register(scan(noise(), stamp_ns=STAMP_NS + 4 * ten_s))
    assert (again.seq, again.outcome) == (6, "start")


def without_times() -> gyre.Scan:
    """A scan whose times were overwritten."""
    mine = scan(noise())
    mine.azimuth_stamp_ns[:] = 0
    return mine


def test_a_network_that_fails_is_not_the_fault_of_the_scan(tmp_path: Path) -> None:
    if not os.environ.get("ORT_DYLIB_PATH"):
        pytest.skip("ORT_DYLIB_PATH names no ONNX Runtime")
    models = ROOT / "shared/method/masking/tests/models"
    model, scale = (models / "single-127.onnx").read_bytes(), b"B\x05scaleJ\x04" + struct.pack("<f", 1 / 16)
    assert model.count(scale) == 1
    broken = model.replace(scale, scale[:-4] + struct.pack("<f", float("nan")))
    (tmp_path / "single-127.onnx").write_bytes(broken)
    card, (old, new) = (models / "single-127.toml").read_text(), (hashlib.sha256(it).hexdigest() for it in (model, broken))
    (tmp_path / "single-127.toml").write_text(card.replace(old, new))
    masking = {"kind": "learned", "model": tmp_path / "single-127.toml", "backend": "onnxruntime"}
    config = gyre.Config({"masking": masking, "raster": {"n": 127, "cell_m": 0.8}})
    for process in (gyre.Odometry(config).register, gyre.Masker(config).mask):
        with pytest.raises(gyre.Error, match="factors are NaN") as failed:
            process(scan(noise()))
        assert type(failed.value) is gyre.Error
        with pytest.raises(gyre.ScanError):
            process(without_times())


def test_a_read_only_array_can_be_registered() -> None:
    array = np.frombuffer(noise().tobytes(), dtype=np.uint8).reshape(400, 576)
    assert gyre.Odometry().register(scan(array)).outcome == "start"


def test_an_array_that_is_not_contiguous_is_refused_with_what_to_do() -> None:
    for array in (noise()[:, 11:], noise()[::2], np.asfortranarray(noise())):
        with pytest.raises(ValueError, match=r"np\.ascontiguousarray\(power\)"):
            scan(array)
    with pytest.raises(ValueError, match=r"np\.ascontiguousarray"):
        scan(noise().T)


@pytest.mark.parametrize(
    "array",
    [
        noise().astype(np.float32),
        noise().astype(np.int8),
        noise().astype(">u2"),
        noise()[0],
        noise()[None],
        noise().tolist(),
        noise().tobytes(),
        None,
        "power",
        np.array([[object()]]),
    ],
    ids=lambda array: type(array).__name__ + str(getattr(array, "dtype", "")),
)
def test_powers_of_another_type_are_refused(array: Any) -> None:
    with pytest.raises(TypeError, match="power is .* expected a C-contiguous array of uint8"):
        scan(array)


@pytest.mark.parametrize(
    "changed",
    [
        {"sweep_s": None},
        {"azimuth_stamp_ns": np.zeros(400, np.int64)},
        {"sweep_s": float("nan")},
        {"sweep_s": -0.25},
        {"sweep_s": 0.0},
        {"sweep_s": 1e300},
        {"range_resolution_m": float("nan")},
        {"range_resolution_m": 0.0},
        {"range_resolution_m": float("inf")},
        {"range_offset_m": float("nan")},
        {"doppler_s": 7.0},
        {"azimuth_rad": np.zeros(399, np.float32)},
        {"azimuth_rad": np.full(400, np.nan, np.float32)},
        {"azimuth_rad": np.zeros((20, 20), np.float32)},
        {"azimuth_flags": np.ones(3, np.uint8)},
        {"sweep_s": None, "azimuth_stamp_ns": np.zeros(400, np.int64)},
        {"sweep_s": None, "azimuth_stamp_ns": STAMP_NS - np.arange(400) * 1_000_000_000},
        {"stamp_ns": 2**63 - 1, "sweep_s": None, "azimuth_stamp_ns": np.full(400, -(2**63))},
    ],
    ids=str,
)
def test_an_inconsistent_scan_is_refused(changed: dict[str, Any]) -> None:
    with pytest.raises((gyre.ScanError, TypeError)) as refused:
        scan(noise(), **changed)
    assert len(str(refused.value)) > 20


@pytest.mark.parametrize(
    "changed",
    [
        {"azimuth_rad": ["a"] * 400},
        {"azimuth_rad": np.zeros(400, complex)},
        {"sweep_s": None, "azimuth_stamp_ns": np.linspace(0, 0.25, 400)},
        {"sweep_s": None, "azimuth_stamp_ns": [[1, 2], [3]]},
        {"azimuth_flags": np.ones(400, np.int64)},
        {"stamp_ns": 1.5},
        {"stamp_ns": None},
        {"clockwise": 3},
        {"range_resolution_m": "0.1"},
    ],
    ids=str,
)
def test_numbers_of_another_type_are_refused(changed: dict[str, Any]) -> None:
    with pytest.raises((TypeError, ValueError)):
        scan(noise(), **changed)


def test_a_scan_needs_its_constants_and_times() -> None:
    untyped: Any = gyre.Scan
    with pytest.raises(TypeError, match="stamp_ns"):
        untyped(noise())
    with pytest.raises(gyre.ScanError, match="either azimuth_stamp_ns.*or sweep_s"):
        scan(noise(), sweep_s=None)


def test_a_scan_that_is_empty_or_too_large_is_refused() -> None:
    for shape in ((0, 10), (10, 0), (0, 0), (1025, 10)):
        with pytest.raises(gyre.ScanError):
            scan(np.zeros(shape, np.uint8))


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_an_array_that_is_changed_in_place_is_refused_or_registered() -> None:
    def change_type(mine: gyre.Scan) -> None:
        stamps: Any = mine.azimuth_stamp_ns
        stamps.dtype = np.int8

    def change_shape(mine: gyre.Scan) -> None:
        mine.azimuth_rad.shape = (20, 20)

    def spoil(mine: gyre.Scan) -> None:
        mine.azimuth_rad[7] = np.nan

    for change in (change_type, change_shape, spoil):
        mine = scan(noise())
        try:
            change(mine)
        except AttributeError:
            continue  # numpy does not allow it any more
        with pytest.raises((TypeError, gyre.ScanError)):
            gyre.Odometry().register(mine)


def test_two_threads_find_what_one_finds() -> None:
    scans = [scan(noise(), stamp_ns=STAMP_NS + k * 250_000_000) for k in range(8)]

    def poses() -> list[Any]:
        odometry = gyre.Odometry()
        return [odometry.register(mine).pose.matrix.tolist() for mine in scans]

    found: list[list[Any]] = []
    threads = [threading.Thread(target=lambda: found.append(poses())) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [poses()] * 2


def test_two_threads_can_share_an_odometry() -> None:
    odometry, mine = gyre.Odometry(), scan(noise())
    threads = [threading.Thread(target=lambda: [odometry.register(mine) for _ in range(4)]) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(odometry.trajectory) == 8


def velocity(registered: gyre.Registered) -> tuple[float, float, float] | None:
    """The constant velocity of a searched motion: m/s, m/s, rad/s."""
    if registered.searched is None:
        return None
    x_m, y_m, yaw_rad = registered.searched.x_m, registered.searched.y_m, registered.searched.yaw_rad
    half, per_s = 0.5 * yaw_rad, 1e9 / registered.interval_ns
    along = half / np.tan(half) if half else 1.0
    return (along * x_m + half * y_m) * per_s, (along * y_m - half * x_m) * per_s, yaw_rad * per_s


def test_rows_of_scans_that_lost_azimuths_lie_where_odometry_has_them(radiate: Path) -> None:
    config = gyre.Config.of(radiate)
    masker, odometry = gyre.Masker(config), gyre.Odometry(config)
    velocities: list[tuple[float, float, float] | None] = [None, None]
    as_recorded = 0
    for mine in list(gyre.open(radiate, config))[:24]:
        masked = masker.mask(mine, velocity=velocities[-2])
        alone = gyre.Masker(config).mask(mine)
        velocities.append(velocity(odometry.register(mine)))
        np.testing.assert_allclose(masked.points["x_m"], odometry.points["x_m"], atol=1e-3)
        as_recorded += np.allclose(alone.points["x_m"], odometry.points["x_m"], atol=1e-3)
    assert 6 < as_recorded < 20


def test_samples_of_gyro_and_wheels_are_finite_and_in_order() -> None:
    def with_samples(
        gyro: list[tuple[int, float]] | None = None, wheels: list[tuple[int, float]] | None = None
    ) -> gyre.Scan:
        return gyre.Scan(
            noise(),
            stamp_ns=STAMP_NS,
            range_resolution_m=0.175,
            clockwise=True,
            sweep_s=0.25,
            gyro=gyro,
            wheels=wheels,
        )

    pairs = [(STAMP_NS - 50_000_000, 0.1), (STAMP_NS, 0.2)]
    both = with_samples(pairs, pairs[1:])
    assert both.gyro == pairs and both.wheels == pairs[1:]
    assert scan(noise()).gyro == [] and scan(noise()).wheels == []
    for wrong, sentence in [
        ([(STAMP_NS, 0.1), (STAMP_NS, 0.2)], "the times of {} must increase"),
        ([(STAMP_NS, float("nan"))], "{} is no finite number, or too large, in pair 0"),
        ([(STAMP_NS, 1e4)], "{} is no finite number, or too large, in pair 0"),
    ]:
        with pytest.raises(gyre.ScanError, match=sentence.format("gyro")):
            with_samples(gyro=wrong)
        with pytest.raises(gyre.ScanError, match=sentence.format("wheels")):
            with_samples(wheels=wrong)
