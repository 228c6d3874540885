"""research/lab/realism.py: its statistics on drawn scans, and the whole of it on small recordings.

    python -m pytest research/lab        # with GYRE_PROGRAM=target/debug/gyre

in an environment that has the package `gyre`.
"""

import cmath
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "research/lab"))

import gyre  # noqa: E402
import realism  # noqa: E402
import scan_statistics  # noqa: E402
from realism import Measured  # noqa: E402
from scan_statistics import Sample  # noqa: E402

AZIMUTHS, BINS, RESOLUTION_M, PERIOD_NS = 400, 250, float(np.float32(0.2)), 250_000_000
AZIMUTH, BIN = np.indices((AZIMUTHS, BINS))
PROGRAM = Path(os.environ.get("GYRE_PROGRAM") or Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug/gyre")


def drawn(power, index=0, resolution_m=RESOLUTION_M):
    """The `index`-th scan of a recording, of these powers."""
    turn = np.arange(len(power)) / len(power)
    return gyre.Scan(
        np.ascontiguousarray(power, dtype=np.uint8), stamp_ns=index * PERIOD_NS, range_resolution_m=resolution_m, clockwise=True,
        azimuth_rad=(turn * math.tau).astype(np.float32), azimuth_stamp_ns=index * PERIOD_NS + ((turn - 0.5) * PERIOD_NS).astype(np.int64),
    )


def noise(seed, most):
    return np.random.default_rng(seed).integers(0, most, (AZIMUTHS, BINS), endpoint=True)


def measured(*scans):
    return scan_statistics.statistics([Sample(scan) for scan in scans], scan_statistics.histogram(scans), RESOLUTION_M)


def counts(powers):
    return np.bincount(powers, minlength=256)


# Powers.


def test_a_histogram_knows_its_percentiles_and_share_above():
    known = counts([0, 0, 10, 20, 60, 61, 100, 200, 200, 255])
    assert [scan_statistics.percentile(known, share) for share in (0.0, 0.2, 0.21, 0.5, 0.9, 1.0)] == [0, 0, 10, 60, 200, 255]
    assert (scan_statistics.share_above(known, 60), scan_statistics.share_above(known, 255)) == (0.5, 0.0)


@pytest.mark.parametrize("seed", range(50))
def test_wasserstein_is_the_mean_difference_of_sorted_powers(seed):
    random = np.random.default_rng(seed)
    a, b = np.sort(random.integers(0, 256, (2, random.integers(1, 50))))
    direct = np.mean(np.abs(a - b))
    assert abs(scan_statistics.wasserstein(counts(a), counts(b)) - direct) < 1e-9
    # As often as you like: shares count, not numbers.
    assert abs(scan_statistics.wasserstein(counts(np.tile(a, 2)), counts(b)) - direct) < 1e-9
    shift = random.integers(0, 56)
    assert abs(scan_statistics.wasserstein(counts(a * 199 // 255), counts(a * 199 // 255 + shift)) - shift) < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_a_cell_is_the_mean_over_the_range_that_it_covers(seed):
    random = np.random.default_rng(seed)
    row, resolution_m = random.integers(0, 256, 40), float(np.float32(random.uniform(1.0, 6.0) * RESOLUTION_M))
    cells = scan_statistics.resample(drawn(row[None]), resolution_m, 6).power[0]
    # By small steps instead of sums.
    steps = (np.arange(60_000) + 0.5) / 10_000 * resolution_m / RESOLUTION_M
    direct = row[steps.astype(int)].reshape(6, -1).mean(axis=1)
    assert np.all(np.abs(cells - direct) < 0.6), (cells, direct)


def test_the_common_grid_is_the_coarsest_over_the_shortest_range():
    fine, coarse = drawn(np.zeros((1, 3768)), resolution_m=0.0438), drawn(np.zeros((1, 576)), resolution_m=100.0 / 576.0)
    assert scan_statistics.common_grid([fine, coarse]) == (float(np.float32(100.0 / 576.0)), 576)
    assert scan_statistics.common_grid([fine])[1] == 3768
    with pytest.raises(scan_statistics.Failure, match="no range in common"):
        scan_statistics.common_grid([fine, drawn(np.zeros((1, 1)), resolution_m=0.04)])


def test_azimuths_and_times_survive_the_common_grid():
    scan = drawn(BIN, 3)
    resampled = scan_statistics.resample(scan, 2.0 * RESOLUTION_M, BINS // 2)
    assert np.array_equal(resampled.azimuth_rad, scan.azimuth_rad)
    assert np.array_equal(resampled.azimuth_stamp_ns, scan.azimuth_stamp_ns)
    assert resampled.stamp_ns == scan.stamp_ns
    # 0.5 and 2.5 counts: rounded away from zero.
    assert list(resampled.power[7, :2]) == [1, 3]


def test_powers_are_known_range_by_range():
    one = drawn(np.where(AZIMUTH < 40, 100, BIN % 50))
    statistics = measured(one, one)
    assert statistics["scans"] == 2
    assert statistics["mean_power"][0] == 10.0
    assert statistics["mean_power"][149] == 0.1 * 100.0 + 0.9 * 49.0
    assert statistics["share_above"] == 0.1
    # 9.5 to 10.5 m are bins 47 to 52: powers 47, 48, 49, 0, 1 and 2.
    assert abs(statistics["power_at_10_m"] - (10.0 + 0.9 * 147.0 / 6.0)) < 1e-9


def test_saturated_bins_are_those_that_pile_up_at_the_top():
    power = np.full((AZIMUTHS, BINS), 20)
    power[0:4, :25], power[4:8, :25], power[8:12, :25] = 160, 157, 156
    assert measured(drawn(power))["saturated_share"] == 200.0 / power.size
    assert scan_statistics.saturated_share(counts([3, 0])) == 0.0


# Texture.


def smoothed(seed, azimuths, bins):
    """Noise averaged over so many azimuths and bins."""
    shifts = [(a, b) for a in range(azimuths) for b in range(bins)]
    return drawn(np.round(sum(np.roll(noise(seed, 255), (-a, -b), (0, 1)) for a, b in shifts) / len(shifts)))


def correlations(*scans):
    samples = [Sample(scan) for scan in scans]
    means = scan_statistics.mean_power(samples)
    return scan_statistics.correlation_in_range(samples, means, RESOLUTION_M), scan_statistics.correlation_in_azimuth(samples, means)


# Autocorrelation of noise through a box of m: 1 - lag / m.
@pytest.mark.parametrize(("azimuths", "bins"), [(1, 8), (6, 1), (4, 10)])
def test_noise_averaged_over_a_width_is_correlated_over_half_of_it(azimuths, bins):
    one = smoothed(1, azimuths, bins)
    statistics = measured(one)
    assert statistics["range_correlation_m"] == pytest.approx(max(0.5 * bins, 0.5) * RESOLUTION_M, rel=0.05)
    assert statistics["azimuth_correlation_deg"] == pytest.approx(max(0.5 * azimuths, 0.5) * 0.9, rel=0.05)
    in_range, _ = correlations(one)
    expected = np.maximum(1.0 - np.arange(len(in_range)) / bins, 0.0)
    assert np.all(np.abs(in_range - expected) < 0.05)


def test_what_is_usual_at_a_range_correlates_nothing():
    in_range, in_azimuth = correlations(drawn(240 - np.minimum(BIN, 200) + noise(2, 9)))
    assert abs(in_range[1]) < 0.02 and abs(in_azimuth[1]) < 0.02
    assert measured(drawn(BIN))["range_correlation_m"] is None


@pytest.mark.parametrize("seed", range(8))
def test_the_autocorrelation_is_the_direct_sum(seed):
    scans = smoothed(seed, 2, 3), smoothed(seed ^ 1, 3, 2)
    in_range, in_azimuth = correlations(*scans)
    rest = np.stack([scan.power for scan in scans]).astype(float)
    rest -= rest.mean(axis=(0, 1))
    for lag in range(20):
        along = (rest[..., : BINS - lag] * rest[..., lag:]).mean()
        assert abs(in_range[lag] - along / (rest**2).mean()) < 1e-9
        across = (rest * np.roll(rest, -lag, axis=1)).mean()
        assert abs(in_azimuth[lag] - across / (rest**2).mean()) < 1e-9


@pytest.mark.parametrize(("curve", "lag"), [([1.0, 0.75, 0.25], 1.5), ([1.0, 0.5], 1.0), ([1.0, 0.9, 0.8], None), ([], None)])
def test_a_length_lies_between_the_lags_and_is_none_where_the_curve_stays_high(curve, lag):
    assert scan_statistics.lag_at_half(curve) == lag


# The change from a scan to the next.

STANDING = (0.0 + 0.0j, 0.0)


def posts(places, index, pose=lambda _: STANDING):
    """A scan of posts, each a few bins deep and three azimuths wide, by a sensor that is at `pose(seconds since its stamp)`."""
    scan = drawn(np.zeros((AZIMUTHS, BINS)), index)
    for azimuth, stamp_ns in enumerate(scan.azimuth_stamp_ns):
        position, yaw = pose((stamp_ns - scan.stamp_ns) * 1e-9)
        for place in places:
            seen = (place - position) * cmath.exp(-1j * yaw)
            off = math.remainder(-cmath.phase(seen) - float(scan.azimuth_rad[azimuth]), math.tau)
            bin_ = int(abs(seen) / RESOLUTION_M)
            if abs(off) < 1.5 * math.tau / AZIMUTHS and 2 <= bin_ < BINS - 2:
                scan.power[azimuth, bin_ - 1 : bin_ + 2] = 200
    return scan


def town(seed):
    """Posts that stand about, some 4 m apart."""
    places = np.random.default_rng(seed).uniform(-30.0, 30.0, (120, 2)) @ [1.0, 1.0j]
    return places[np.abs(places) > 4.0]


def between(earlier, later, motion=STANDING):
    """The pairs, the correlation and the share without counterpart of two scans, the later one 0.25 s after the earlier."""
    return scan_statistics.change([Sample(earlier), Sample(later, motion)], BINS * RESOLUTION_M, 60)


def test_the_same_scan_twice_has_not_changed():
    pairs, correlation, unmatched = between(posts(town(3), 0), posts(town(3), 1))
    assert correlation > 1.0 - 1e-9 and unmatched == 0.0 and pairs == 1


def test_two_different_scenes_have_nothing_in_common():
    _, correlation, unmatched = between(posts(town(3), 0), posts(town(4), 1))
    assert correlation < 0.15 and unmatched > 0.6, (correlation, unmatched)


def test_a_drive_is_undone_by_its_motion_and_by_no_other():
    # 12 m/s and 30 deg/s: 3 m and 7.5 degrees from scan to scan, and as much within a sweep.
    def driven(t_s):
        return 12.0 / 0.52 * (cmath.exp(0.52j * t_s) - 1.0) / 1j, 0.52 * t_s

    one, two = posts(town(3), 0, driven), posts(town(3), 1, lambda t_s: driven(0.25 + t_s))
    position, yaw = driven(0.25)
    _, correlation, unmatched = between(one, two, (position, yaw))
    assert correlation > 0.7 and unmatched < 0.05, (correlation, unmatched)
    for wrong in (STANDING, driven(-0.25), (position + cmath.exp(1j * yaw), yaw)):
        _, correlation, unmatched = between(one, two, wrong)
        assert correlation < 0.4 and unmatched > 0.2, (wrong, correlation, unmatched)


def test_a_motion_that_no_sensor_makes_is_not_compared():
    motions = [STANDING, (complex(math.nan, 0.0), 0.0), STANDING, None, (1e6 + 0j, 0.0)]
    samples = [Sample(posts(town(3), index), motion) for index, motion in enumerate(motions)]
    assert scan_statistics.change(samples, BINS * RESOLUTION_M, 60)[0] == 1


def test_a_post_that_is_gone_is_one_of_many_without_counterpart():
    # On a circle, so that all of them cover as many cells.
    circle = [cmath.rect(20.0, 0.314 * k) for k in range(20)]
    _, _, unmatched = between(posts(circle, 0), posts(circle[:15], 1))
    assert abs(unmatched - 5.0 / 35.0) < 0.02, unmatched


# Recordings and the comparison.


def test_poses_are_known_up_to_rounding_and_not_in_gaps():
    stamps = [1_000_000_000, 2_000_000_000, 3_000_000_001]
    track = gyre.Trajectory(stamps, [[1.0, 0.0, 3.0], [2.0, 0.0, -3.0], [3.0, 0.0, 0.0]])

    def x(stamp_ns):
        pose = realism.pose(track, stamp_ns)
        return pose and pose[0].real

    assert [x(999_000_000), x(1_500_000_000), x(2_000_000_000), x(3_000_000_001), x(3_001_000_001)] == [1.0, 1.5, 2.0, 3.0, 3.0]
    assert [x(998_999_999), x(2_000_000_001), x(2_500_000_000), x(3_001_000_002)] == [None] * 4
    # It turns the shorter way.
    assert abs(realism.pose(track, 1_500_000_000)[1]) == pytest.approx(math.pi)
    assert realism.motion_between(track, 1_000_000_000, 2_000_000_000)[1] == pytest.approx(math.tau - 6.0)


def test_runs_cover_a_short_recording_and_spread_over_a_long_one():
    assert realism.runs(11, 64) == [range(0, 11)]
    assert realism.runs(100, 16) == [range(0, 8), range(92, 100)]
    assert realism.runs(100, 8) == [range(0, 8)]
    assert realism.runs(100, 3) == [range(0, 3)]
    spread = realism.runs(466, 64)
    assert (len(spread), spread[0], spread[7]) == (8, range(0, 8), range(458, 466))
    assert all(earlier.stop <= later.start for earlier, later in zip(spread, spread[1:]))
    assert all(run.stop <= 65 for run in realism.runs(65, 64))


def recorded(seed, gain, errors):
    """The statistics of a recording of noise with a wall, brighter by `gain`, whose searches are `errors` off."""
    wall = (BIN >= 100) & (BIN < 104) & (AZIMUTH % 3 == 0)
    searched = {"rpe": {"translation_rmse_m": errors, "rotation_rmse_deg": 2.0 * errors}}
    figures = {"next_correlation": 1.0 - errors, "next_unmatched_share": errors, "plain": searched, "refined": searched}
    return measured(drawn(noise(seed, 40) + gain + np.where(wall, 60, 0))) | figures


def compared(sim, real, other=None):
    """The rows of a comparison by their statistics, and what it says at its end."""
    wholes = [of if of is None or isinstance(of, Measured) else Measured(of, []) for of in (sim, real, other)]
    rows, verdict = realism.compare(*wholes)
    return {row["statistic"]: row for row in rows}, verdict


def test_a_recording_is_at_no_distance_from_itself():
    one = recorded(1, 0, 0.1)
    rows, verdict = compared(one, one, recorded(4, 30, 0.3))
    for row in rows.values():
        unknown = row["sim"] is None
        assert (row["sim_real"], row["closer"]) == ((None, None) if unknown else (0.0, True)), row
    assert sum(row["sim"] is not None for row in rows.values()) == 12
    assert verdict.strip() == "closer in 12 of 12"


def test_distances_have_the_units_that_they_name():
    rows, verdict = compared(recorded(1, 0, 0.1), recorded(1, 30, 0.2))
    for statistic, kind, expected in [
        ("histogram of power", "Wasserstein, counts", 30.0),
        ("mean power against range", "RMS, counts", 30.0),
        ("correlation length in range", "abs. log ratio", 0.0),
        ("next scan: correlation", "abs. difference", 0.1),
        ("next scan: returns without counterpart", "abs. log ratio", math.log(2.0)),
        ("plain search: translation of a motion", "abs. log ratio", math.log(2.0)),
        ("refined search: rotation of a motion", "abs. log ratio", math.log(2.0)),
    ]:
        assert rows[statistic]["sim_real"] == pytest.approx(expected, abs=1e-4)
        assert rows[statistic]["distance"] == kind
    assert verdict == ""


def test_figures_are_shown_with_their_units():
    one = recorded(1, 0, 0.1)
    shown = {statistic: row["sim"] for statistic, row in compared(one, one)[0].items()}
    assert shown["next scan: correlation"] == "0.900"
    assert shown["next scan: returns without counterpart"] == "10.00 %"
    assert shown["plain search: translation of a motion"] == "0.100 m"
    assert shown["refined search: rotation of a motion"] == "0.200 deg"
    assert shown["share of saturated bins"].endswith(" %")
    assert shown["histogram of power"].startswith("50 %: 2")
    assert float(shown["mean power against range"].removeprefix("10 m: ")) == pytest.approx(20.0, abs=1.0)


def test_the_nearer_recording_is_closer_and_what_is_not_known_is_not_judged():
    near = recorded(2, 2, 0.11) | {"plain": {"rpe": {"rotation_rmse_deg": 0.22}}}
    real = Measured(recorded(1, 0, 0.1), [recorded(1, 0, 0.1), recorded(1, 1, 0.2)])
    rows, _ = compared(near, real, recorded(3, 40, 0.5))
    assert rows["histogram of power"]["closer"] is True
    assert rows["histogram of power"]["within_real"] == pytest.approx(1.0, abs=1e-9)
    assert rows["histogram of power"]["within_other"] is None
    assert rows["refined search: translation of a motion"]["closer"] is True
    plain = rows["plain search: translation of a motion"]
    assert [plain[key] for key in ("closer", "sim_real", "sim", "verdict")] == [None] * 4
    assert plain["real_other"] is not None


@pytest.mark.parametrize(("gain", "verdict"), [(4, "closer"), (19, "farther, within chance"), (21, "farther")])
def test_farther_than_another_but_not_than_halves_of_one_is_chance(gain, verdict):
    real = Measured(recorded(1, 0, 0.1), [recorded(1, 0, 0.1), recorded(1, 20, 0.1)])
    rows, _ = compared(recorded(1, gain, 0.1), real, recorded(1, 5, 0.1))
    assert rows["histogram of power"]["verdict"] == verdict


# The whole of it.


@pytest.fixture
def folder(tmp_path):
    """A folder with `small`, a drive, `other`, one through another town, and the configuration that they are read with."""
    if not PROGRAM.is_file():
        pytest.skip(f"there is no {PROGRAM}: build it, or name another by GYRE_PROGRAM")
    for name, changes in (("small", ["scans=24"]), ("single", ["scans=1"]), ("other", ["scans=8", "seed=7"])):
        changes = [argument for change in changes for argument in ("--set", f"simulation.{change}")]
        # A radar of few bins.
        radar = ["--set", "simulation.sensor.profile=cts350x-radiate", "--format", "oxford"]
        command = [PROGRAM, "simulate", ROOT / "configs/demo.toml", "--out", tmp_path / name, *radar, *changes]
        subprocess.run(command, check=True, capture_output=True)
    (tmp_path / "small.toml").write_text("[raster]\nn = 127\ncell_m = 0.8\n")
    return tmp_path


def compare(folder, *arguments):
    command = [sys.executable, ROOT / "research/lab/realism.py", "--out", "out", "--gyre", PROGRAM, *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def rows_of(folder, *arguments):
    """The rows, and what is printed."""
    done = compare(folder, *arguments)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "out/realism.json").read_text())["tables"][0]["rows"], done.stdout


SMALL = ["--sim-config", "small.toml", "--real-config", "small.toml"]


def test_a_recording_is_closer_to_itself_than_another_is_in_all_that_is_measured(folder):
    arguments = ["small", "small", "--between", "other", "--scans", "8", *SMALL, "--between-config", "small.toml"]
    rows, printed = rows_of(folder, *arguments)
    assert all(row["sim_real"] == 0.0 for row in rows if row["sim"] is not None), rows
    judged = [row["closer"] for row in rows if row["closer"] is not None]
    assert len(judged) >= 12 and all(judged), rows
    assert printed.splitlines()[-1] == f"closer in {len(judged)} of {len(judged)}"
    assert (folder / "out/realism.md").read_text() == printed
    assert "sim: small, 8 scans, 7 pairs" in printed and "other: other, 8 scans" in printed


def test_one_scan_and_a_recording_without_truth_have_what_can_be_had(folder):
    shutil.rmtree(folder / "other/gt")
    (folder / "other/ground_truth.tum").unlink()
    rows, printed = rows_of(folder, "single", "other", *SMALL)
    # Aligned by odometry.
    assert "real: other, 8 scans, 7 pairs" in printed
    for row in rows:
        needs_two = row["statistic"].startswith(("next scan", "plain search", "refined search", "searched and refined"))
        assert (row["sim"] is None, row["sim_real"] is None) == (needs_two, needs_two), row
        # So short a drive has no turn.
        if not row["statistic"].endswith("in turns"):
            assert (row["real"] is None) == (" search: " in row["statistic"]), row
        assert row["closer"] is None, row


def test_without_runs_the_scans_alone_are_measured(folder):
    rows, printed = rows_of(folder, "small", "other", "--search-scans", "0", "--scans", "5")
    assert "sim: small, 5 scans, 4 pairs" in printed
    assert not (folder / "out/sim").exists()
    assert rows[0]["sim_real"] > 0.01


def test_what_cannot_be_compared_is_refused(folder):
    for arguments, named in ((["other", "nowhere"], "nowhere"), (["other", "other", "--real-config", "none.toml"], "none.toml")):
        done = compare(folder, *arguments)
        assert done.returncode == 1 and named in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


def test_one_drive_is_closer_to_itself_than_to_another(tmp_path):
    """Another part of the same drive is nearer than a drive with another radar of the same kind."""
    data = Path(os.environ.get("GYRE_DATA", ""))
    radiate, oxford = data / "radiate-2019-02-12", data / "oxford-2019-01-10-14-36-48"
    if not os.environ.get("GYRE_DATA") or not radiate.is_dir() or not oxford.is_dir():
        pytest.skip("there are no real scans: GYRE_DATA names no folder with radiate-2019-02-12 and an Oxford drive")
    for name, source in (("first.toml", "scans = 80"), ("second.toml", "first = 300\nscans = 80")):
        (tmp_path / name).write_text(f'[dataset]\nformat = "radiate"\nrange_offset_m = -0.15\n[source]\n{source}\n')
    configs = ["--sim-config", "first.toml", "--real-config", "second.toml", "--search-scans", "0"]
    rows, _ = rows_of(tmp_path, radiate, radiate, "--between", oxford, *configs)
    for index, factor in ((0, 10.0), (1, 5.0), (5, 5.0)):
        assert factor * rows[index]["sim_real"] < rows[index]["real_other"], rows[index]
