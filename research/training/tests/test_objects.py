"""The network that finds moving objects: its input, its truth, and that it learns."""

import numpy as np
import onnxruntime
import torch
from gyre_training import objects
from gyre_training.planes import export

POST = (20.2, 0.2)


def scan(x_m: float, users=(), yaw_rad: float = 0.0) -> objects.Scan:
    """A scan of one post of the world from a sensor that stands, and of road users."""
    seen = objects.rotated(np.array([[POST[0] - x_m, POST[1]]]), np.array([-yaw_rad]))
    points = np.column_stack([seen, [0.1], [0.6], [0.05]])
    return objects.Scan(np.array([x_m, 0.0, yaw_rad]), np.zeros(3), points, np.array(users, float).reshape(-1, 10))


def test_what_stands_is_in_one_cell_of_all_planes():
    drive = [scan(2.0 * index) for index in range(9)]
    planes = objects.drawn(objects.samples(drive)[-1], mirrored=False)
    # The sensor is at 16 m: the post is 4.2 m ahead, and 0.2 m to the left.
    row, column = 8 + objects.SIDE // 2, objects.SIDE // 2
    assert np.allclose(planes[: objects.RECENT, row, column], 0.6, atol=1 / 255)
    assert planes[objects.RECENT, row, column] == 1.0
    assert np.count_nonzero(planes[:-1]) == objects.RECENT + 1
    assert np.isclose(planes[-1, row, column], np.hypot(4.25, 0.25) / 64)
    mirrored = objects.drawn(objects.samples(drive)[-1], mirrored=True)
    assert mirrored[0, row, column - 1] == planes[0, row, column]


def test_points_are_deskewed_as_by_gyre():
    # A sensor that turns on the spot: the point keeps its range and turns with it.
    points = np.array([[10.0, 0.0, 0.1, 1.0, 0.0]])
    (turned,) = objects.deskewed(points, np.array([0.0, 0.0, 0.5]))
    assert np.allclose(turned, [10 * np.cos(0.05), 10 * np.sin(0.05)])
    # One that drives ahead: 0.8 m nearer, and the Doppler shift makes it 0.4 m farther again.
    points[0, 4] = 0.05
    (ahead,) = objects.deskewed(points, np.array([8.0, 0.0, 0.0]))
    assert np.allclose(ahead, [10 + 0.8 + 0.4, 0.0])


def test_a_car_is_wanted_where_the_beam_shows_it():
    car = (7, 20.0, 0.0, -10.0, 0.0, np.pi, 1, 1, 4.5, 1.9)
    sample = objects.samples([scan(0.0, [car])] * 3)[-1]
    x, y, vx = sample.users[0, :3]
    # Seen 0.1 s later, and shortened by 0.05 s times 10 m/s.
    assert np.isclose(x, 20.0 - 1.0 - 0.5, atol=1e-3) and np.isclose(y, 0.0, atol=1e-3)
    likely, counts, values, near = objects.wanted(sample, mirrored=False)
    row, column = 18 + objects.OUT // 2, objects.OUT // 2
    assert likely[row, column] == 1.0 and counts.min() == 1.0
    assert near[row, column] == 1.0 and near.sum() < 12
    assert np.allclose(values[:, row, column], [0.0, -0.5, -10.0, 0.0, -1.0, 0.0, 0.0, 0.0], atol=2e-3)


def test_a_repainted_car_has_other_echoes_where_it_is_and_what_stands_keeps_its_own():
    def sight(index: int) -> objects.Scan:
        car = (7, 25.0 - 2.5 * index, 6.0, -10.0, 0.0, np.pi, 1, 1, 4.5, 1.9)
        plain = scan(0.0, [car])
        x, y = objects.shown(plain)[0, :2]
        corners = np.array([[x + ahead, y + aside, 0.1, 0.9, 0.05] for ahead in (-2.2, 2.2) for aside in (-0.9, 0.9)])
        return objects.Scan(plain.pose, plain.twist, np.concatenate([plain.points, corners]), plain.users)

    drive = [sight(index) for index in range(6)]
    random = np.random.default_rng(3)
    counts = []
    for _ in range(20):
        for before, after in zip(drive, objects.repainted(drive, random)):
            assert np.array_equal(after.points[0], before.points[0])
            off = objects.deskewed(after.points[1:], after.twist) - objects.shown(before)[0, :2]
            counts.append(len(off))
            if len(off):
                assert np.median(np.abs(off[:, 0])) < 3.5 and np.abs(off[:, 1]).max() < 3.0
                assert (after.points[1:, 3] > 0).all() and (after.points[1:, 3] <= 1).all()
    assert 4 < np.mean(counts) < 30 and len(set(counts)) > 10
    # A vehicle that is hidden stays so.
    hidden = [scan(0.0, [(7, 25.0, 0.0, -10.0, 0.0, np.pi, 1, 0, 4.5, 1.9)])] * 3
    assert all(len(it.points) == 1 for it in objects.repainted(hidden, random))


def test_what_is_hidden_or_a_pedestrian_counts_neither_way():
    hidden = (7, 20.0, 0.0, -10.0, 0.0, np.pi, 1, 0, 4.5, 1.9)
    pedestrian = (8, 20.0, 15.0, 1.4, 0.0, 0.0, 0, 1, 0.5, 0.5)
    parked = (9, -20.0, 0.0, 0.0, 0.0, 0.0, 1, 1, 4.5, 1.9)
    likely, counts, _, near = objects.wanted(objects.samples([scan(0.0, [hidden, pedestrian, parked])] * 3)[-1], mirrored=False)
    assert likely.max() == 0.0 and near.max() == 0.0
    assert 0 < np.count_nonzero(counts == 0) < 60
    assert counts[objects.OUT // 2 - 20, objects.OUT // 2] == 1.0


def test_it_learns_and_is_written_as_it_is(tmp_path):
    car = (7, 20.0, 0.0, -10.0, 0.0, np.pi, 1, 1, 4.5, 1.9)
    drive = [scan(0.0, [car])] * 10
    values = np.concatenate(
        [np.concatenate([[0.0], it.pose, it.twist, [len(it.points), len(it.users)], it.points.ravel(), it.users.ravel()]) for it in drive]
    )
    values.astype("<f8").tofile(tmp_path / "drive")
    assert np.allclose(objects.read(tmp_path / "drive")[3].points, drive[3].points)
    torch.manual_seed(1)
    sample = objects.samples(drive)[-1]
    planes = torch.from_numpy(objects.drawn(sample, False)[None])
    targets = [torch.from_numpy(it[None]) for it in objects.wanted(sample, False)]
    before = objects.loss(objects.Network().eval()(planes), *targets).item()
    network = objects.train(objects.samples(drive), steps=80, batch=2)
    assert objects.loss(network.eval()(planes), *targets).item() < 0.5 * before
    export(network, torch.zeros(1, objects.PLANES, objects.SIDE, objects.SIDE), tmp_path / "network.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "network.onnx")
    (given,) = session.run(None, {"planes": planes.numpy()})
    assert given.shape == (1, 4 * objects.VALUES, objects.OUT // 2, objects.OUT // 2)
    assert np.allclose(given, network(planes).detach().numpy(), atol=1e-3)
