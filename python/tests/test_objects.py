"""`gyre evaluate --objects` against motmetrics and TrackEval, and the table of objects as an array."""

import json
import math
import random
from pathlib import Path

import gyre
import motmetrics  # type: ignore[import-untyped]
import numpy as np
import pytest
from conftest import gyre_program
from trackeval.metrics import HOTA  # type: ignore[import-untyped]

SCANS, GATE_M = 40, 4.0
TRUE = "scan,stamp_ns,object,kind,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,length_m,width_m,visible,counts"
TRACKED = (
    "scan,stamp_ns,object,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,length_m,width_m,moving,age,"
    "cov_xx,cov_xy,cov_yy,cov_vxvx,cov_vxvy,cov_vyvy"
)
Places = dict[int, tuple[float, float]]


def drawn(seed: int) -> list[tuple[Places, Places]]:
    """True and tracked places by identity, scan by scan: some are missed, some false, some change their identity.

    Near an object that is not required yet, in its first two scans, nothing is tracked.
    """
    draw = random.Random(seed)
    ways = {number: (draw.uniform(-40, 40), draw.uniform(-40, 40), draw.uniform(3, 9)) for number in range(8)}
    names = {number: 100 + number for number in ways}
    seen: dict[int, int] = {}
    scans = []
    for scan in range(SCANS):
        true = {number: (x + speed * 0.25 * scan - 20, y) for number, (x, y, speed) in ways.items()}
        true = {number: place for number, place in true.items() if math.hypot(*place) < 50}
        for number in true:
            seen[number] = seen.get(number, 0) + 1
        for number in list(names):
            if draw.random() < 0.03:
                names[number] = 1000 * (scan + 1) + number
        found = {
            names[number]: (x + draw.gauss(0, 1.5), y + draw.gauss(0, 1.5))
            for number, (x, y) in true.items()
            if draw.random() < 0.85
        }
        for number in range(draw.randrange(3)):
            found[5000 + 10 * scan + number] = (draw.uniform(-40, 40), draw.uniform(-40, 40))
        early = [place for number, place in true.items() if seen[number] < 3]
        found = {
            number: place for number, place in found.items() if all(math.dist(place, other) > GATE_M for other in early)
        }
        scans.append((true, found))
    return scans


def write(folder: Path, scans: list[tuple[Places, Places]]) -> tuple[Path, Path]:
    """Writes a run and a recording with these objects; the sensor stands, and sees all of them."""
    run, recording = folder / "run", folder / "recording"
    run.mkdir()
    recording.mkdir()
    poses, truth, tracked, tum = ["scan,stamp_ns,x_m,y_m,yaw_rad"], [TRUE], [TRACKED], []
    for scan, (true, found) in enumerate(scans):
        at = 1_547_132_400_000_000_000 + 250_000_000 * scan
        poses.append(f"{scan},{at},0,0,0")
        tum.append(f"{at // 10**9}.{at % 10**9:09d} 0 0 0 0 0 0 1")
        truth += [f"{scan},{at},{i},car,{x!r},{y!r},0,5,0,4.3,1.8,1,100" for i, (x, y) in true.items()]
        tracked += [
            f"{scan},{at},{i},{x!r},{y!r},0,5,0,4.3,1.8,1,9,1,0,1,1,0,1" for i, (x, y) in found.items()
        ]
    for file, lines in [
        (run / "poses.csv", poses),
        (run / "objects.csv", tracked),
        (recording / "objects.csv", truth),
        (recording / "ground_truth.tum", tum),
    ]:
        file.write_text("\n".join(lines) + "\n")
    return run, recording


def judged(scans: list[tuple[Places, Places]]) -> dict[str, float]:
    """The figures of motmetrics; an object is required from its third scan on."""
    seen: dict[int, int] = {}
    accumulator = motmetrics.MOTAccumulator(auto_id=True)
    for true, found in scans:
        for number in true:
            seen[number] = seen.get(number, 0) + 1
        required = {number: place for number, place in true.items() if seen[number] >= 3}
        distances = [
            [d if (d := math.dist(a, b)) <= GATE_M else math.nan for b in found.values()] for a in required.values()
        ]
        accumulator.update(list(required), list(found), distances)
    names = ["num_objects", "num_detections", "num_false_positives", "num_switches", "mota", "precision", "recall"]
    return dict(motmetrics.metrics.create().compute(accumulator, metrics=names).iloc[0])


def hota(scans: list[tuple[Places, Places]]) -> dict[str, float]:
    """The figures of TrackEval, each the mean over all similarities."""
    numbers: tuple[dict[int, int], dict[int, int]] = ({}, {})
    seen: dict[int, int] = {}
    ids: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    similarities = []
    for true, found in scans:
        for number in true:
            seen[number] = seen.get(number, 0) + 1
        required = {number: place for number, place in true.items() if seen[number] >= 3}
        for places, known, listed in zip((required, found), numbers, ids, strict=True):
            listed.append(np.array([known.setdefault(number, len(known)) for number in places], int))
        rows = [[max(0.0, 1 - math.dist(a, b) / GATE_M) for b in found.values()] for a in required.values()]
        similarities.append(np.array(rows).reshape(len(required), len(found)))
    data = {
        "num_gt_ids": len(numbers[0]),
        "num_tracker_ids": len(numbers[1]),
        "num_gt_dets": sum(map(len, ids[0])),
        "num_tracker_dets": sum(map(len, ids[1])),
        "gt_ids": ids[0],
        "tracker_ids": ids[1],
        "similarity_scores": similarities,
    }
    figures = HOTA().eval_sequence(data)
    return {name: float(figures[name].mean()) for name in ("HOTA", "DetA", "AssA")}


@pytest.mark.parametrize("seed", range(5))
def test_the_figures_are_those_of_motmetrics(seed: int, tmp_path: Path) -> None:
    scans = drawn(seed)
    run, recording = write(tmp_path, scans)
    ours = json.loads(gyre_program("evaluate", "--objects", run, recording, "--json"))
    theirs = judged(scans)
    assert theirs["num_switches"] > 0 and theirs["num_false_positives"] > 0
    assert ours["required"] == theirs["num_objects"]
    assert ours["matched"] == theirs["num_detections"]
    assert ours["false_positives"] == theirs["num_false_positives"]
    assert ours["switches"] == theirs["num_switches"]
    for name in ("mota", "precision", "recall"):
        assert ours[name] == pytest.approx(theirs[name], abs=1e-9)
    theirs = hota(scans)
    assert 0.1 < theirs["HOTA"] < 0.9
    for name, their_name in [("hota", "HOTA"), ("hota_detection", "DetA"), ("hota_association", "AssA")]:
        assert ours[name] == pytest.approx(theirs[their_name], abs=1e-9)
    for bands in ("by_range", "by_speed"):
        assert sum(band["required"] for band in ours[bands]) == ours["required"]


def test_figures_by_range_count_a_false_object_in_its_own_band(tmp_path: Path) -> None:
    scans: list[tuple[Places, Places]] = [({1: (10.0, 0.0), 2: (50.0, 0.0)}, {7: (10.5, 0.0), 8: (30.0, 0.0)})] * 6
    bands = json.loads(gyre_program("evaluate", "--objects", *write(tmp_path, scans), "--json"))["by_range"]
    assert [(band["required"], band["recall"], band["precision"]) for band in bands] == [(4, 1, 1), (0, 0, 0), (4, 0, 0)]
    assert bands[0]["position_rmse_m"] == pytest.approx(0.5)


def test_objects_are_read_as_an_array(tmp_path: Path) -> None:
    scans = drawn(1)
    run, _ = write(tmp_path, scans)
    objects = gyre.read_objects(run)
    assert len(objects) == sum(len(found) for _, found in scans)
    assert objects.dtype["moving"] == np.bool_ and objects["moving"].all()
    places = dict(zip(objects["object"][objects["scan"] == 3].tolist(), objects["x_m"][objects["scan"] == 3], strict=True))
    assert places == {number: x for number, (x, _) in scans[3][1].items()}
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / "objects.csv").write_text(TRACKED + "\n")
    assert len(gyre.read_objects(empty)) == 0


def test_objects_that_are_not_there_or_damaged_are_refused(tmp_path: Path) -> None:
    with pytest.raises(gyre.ReadError, match="objects.kind=tracks"):
        gyre.read_objects(tmp_path)
    table = tmp_path / "objects.csv"
    for text, reason in [("", "other columns"), (TRUE, "other columns"), (f"{TRACKED}\n1,2,x", "damaged")]:
        table.write_text(text)
        with pytest.raises(gyre.ReadError, match=reason):
            gyre.read_objects(tmp_path)
