"""Compares the bag of a run with its odometry.csv and trajectory, field by field, by a reader that is not Gyre's own.

usage: check.py BAG OUT [TURNED]

TURNED is the bag of the same run with a radar that looks to the left.
"""

import csv
import json
import math
import sys

import numpy
from rosbags.highlevel import AnyReader
from pathlib import Path

UNKNOWN = 1e6
PLANAR = [0, 1, 5]


def stamp_ns(header):
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def yaw(quaternion):
    assert quaternion.x == 0 and quaternion.y == 0, quaternion
    return 2 * math.atan2(quaternion.z, quaternion.w)


def expanded(planar):
    """The covariance of x, y, z, roll, pitch, yaw from that of x, y, yaw."""
    covariance = numpy.diag([UNKNOWN] * 6)
    covariance[numpy.ix_(PLANAR, PLANAR)] = planar
    return covariance


def close(found, expected, tolerance, what):
    found, expected = numpy.asarray(found), numpy.asarray(expected)
    scale = numpy.maximum(1.0, numpy.abs(expected))
    assert numpy.all(numpy.abs(found - expected) <= tolerance * scale), f"{what}: {found} is not {expected}"


def packed(row):
    names = ["xx", "xy", "xyaw", "yy", "yyaw", "yawyaw"]
    xx, xy, xyaw, yy, yyaw, yawyaw = (float(row[f"cov_{name}"]) for name in names)
    return numpy.array([[xx, xy, xyaw], [xy, yy, yyaw], [xyaw, yyaw, yawyaw]])


def velocity(motion, seconds):
    """The constant velocity in the frame of the vehicle."""
    x, y, turn = motion
    half = turn / 2
    stretch = half / math.sin(half) if abs(half) > 1e-6 else 1.0
    forward = stretch * (math.cos(half) * x + math.sin(half) * y)
    left = stretch * (-math.sin(half) * x + math.cos(half) * y)
    return numpy.array([forward, left, turn]) / seconds


def check_twist(message, row):
    """The velocity, and what small errors of the motion do to it."""
    motion, seconds = numpy.array([float(row[name]) for name in ("x_m", "y_m", "yaw_rad")]), int(row["interval_ns"]) * 1e-9
    twist = message.twist.twist
    close([twist.linear.x, twist.linear.y, twist.angular.z], velocity(motion, seconds), 1e-6, "twist")
    close([twist.linear.z, twist.angular.x, twist.angular.y], [0, 0, 0], 0, "twist out of the plane")
    steps = numpy.eye(3) * 1e-5
    jacobian = numpy.column_stack([velocity(motion + step, seconds) - velocity(motion - step, seconds) for step in steps]) / 2e-5
    measured = expanded(jacobian @ packed(row) @ jacobian.T)
    expected = numpy.diag([UNKNOWN] * 6) if row["outcome"] == "predicted" else measured
    close(message.twist.covariance.reshape(6, 6), expected, 1e-6, "twist covariance")


def compose(pose, row):
    x, y, turn = pose
    dx, dy = float(row["x_m"]), float(row["y_m"])
    return (
        x + math.cos(turn) * dx - math.sin(turn) * dy,
        y + math.sin(turn) * dx + math.cos(turn) * dy,
        turn + float(row["yaw_rad"]),
    )


def map_of(bag):
    """The cells of a bag's map, and their first corner in whole cells."""
    with AnyReader([bag]) as reader:
        (grid,) = (reader.deserialize(data, c.msgtype) for c, _, data in reader.messages() if c.topic == "/map")
    info = grid.info
    assert (info.origin.orientation.z, info.origin.orientation.w) == (0, 1), "Nav2 ignores the rotation of a map"
    corner = [round(value / info.resolution) for value in (info.origin.position.x, info.origin.position.y)]
    return grid.data.reshape(info.height, info.width), corner


def check_turned(bag, turned):
    """What is at (x, y) in the map is at (-y, x) where the radar looks to the left."""
    (cells, (left, bottom)), (turned_cells, (turned_left, turned_bottom)) = map_of(bag), map_of(turned)
    rows, columns = numpy.nonzero(cells != -1)
    x, y = columns + left, rows + bottom
    places = -1 - y - turned_left, x - turned_bottom
    same = turned_cells[places[1], places[0]] == cells[rows, columns]
    assert same.mean() > 0.99, f"{same.mean()} of the cells are where they are to be"
    assert (turned_cells != -1).sum() < 1.01 * len(rows)


def check_objects(detections, markers, out):
    """Each object of objects.csv is a detection of its scan, and an arrow of the length of its speed if it moves."""
    scans = {}
    for row in csv.DictReader((out / "objects.csv").open()):
        scans.setdefault(int(row["stamp_ns"]), {})[row["object"]] = row
    for (logged, array), (_, drawn) in zip(detections, markers, strict=True):
        rows = scans.pop(stamp_ns(array.header), {})
        assert logged == stamp_ns(array.header) and array.header.frame_id == "odom"
        assert {it.id for it in array.detections} == rows.keys() and len(array.detections) == len(rows)
        for it in array.detections:
            row, box, (result,) = rows[it.id], it.bbox, it.results
            assert it.header == array.header
            assert result.hypothesis.class_id == ("moving" if row["moving"] == "1" else "standing")
            position, size, covariance = box.center.position, box.size, result.pose.covariance.reshape(6, 6)
            found = [position.x, position.y, size.x, size.y, *covariance[[0, 0, 1], [0, 1, 1]]]
            names = ["x_m", "y_m", "length_m", "width_m", "cov_xx", "cov_xy", "cov_yy"]
            close(found, [float(row[name]) for name in names], 1e-3, "object")
            close(math.cos(yaw(box.center.orientation) - float(row["yaw_rad"])), 1, 1e-6, "heading")
            assert list(covariance[[2, 3, 4, 5], [2, 3, 4, 5]]) == [UNKNOWN] * 4
        speeds = sorted(math.hypot(float(row["vx_m_s"]), float(row["vy_m_s"])) for row in rows.values() if row["moving"] == "1")
        close(sorted(it.scale.x for it in drawn.markers if it.ns == "velocities"), speeds, 1e-3, "arrows")
    assert not scans, f"{len(scans)} scans with objects have none in the bag"
    return sum(len(array.detections) for _, array in detections)


def main():
    bag, out = Path(sys.argv[1]), Path(sys.argv[2])
    rows = list(csv.DictReader((out / "odometry.csv").open()))
    with AnyReader([bag]) as reader:
        by_topic = {}
        for connection, logged, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            by_topic.setdefault((connection.topic, connection.msgtype), []).append((logged, message))
        qualities = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in reader.connections}
    odometry = [message for _, message in by_topic["/odom", "nav_msgs/msg/Odometry"]]
    assert len(odometry) == len(rows) + 1, f"{len(odometry)} poses of {len(rows)} motions"
    first = odometry[0]
    close(first.pose.covariance.reshape(6, 6), expanded(numpy.zeros((3, 3))), 0, "first covariance")
    close(first.twist.covariance.reshape(6, 6), numpy.diag([UNKNOWN] * 6), 0, "first twist covariance")
    pose = (0.0, 0.0, 0.0)
    poses = list(csv.DictReader((out / "poses.csv").open()))
    transforms = [message for _, message in by_topic["/tf", "tf2_msgs/msg/TFMessage"]]
    for message, transform, row, placed in zip(odometry[1:], transforms[1:], rows, poses[1:], strict=True):
        assert stamp_ns(message.header) == int(row["stamp_ns"])
        assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
        pose = compose(pose, row)
        found = message.pose.pose
        close([found.position.x, found.position.y, found.position.z], [pose[0], pose[1], 0], 1e-6, "position")
        apart = (yaw(found.orientation) - pose[2] + math.pi) % (2 * math.pi) - math.pi
        close(apart, 0, 1e-6, "yaw")
        covariance = message.pose.covariance.reshape(6, 6)
        assert numpy.array_equal(covariance, covariance.T)
        assert list(covariance[[2, 3, 4], [2, 3, 4]]) == [UNKNOWN] * 3
        planar = covariance[numpy.ix_([0, 1, 5], [0, 1, 5])][numpy.triu_indices(3)]
        columns = ["cov_xx", "cov_xy", "cov_xyaw", "cov_yy", "cov_yyaw", "cov_yawyaw"]
        close(planar, [float(placed[column]) for column in columns], 1e-9, "covariance")
        check_twist(message, row)
        moved = {(t.header.frame_id, t.child_frame_id): t.transform for t in transform.transforms}
        moved = moved["odom", "base_link"]
        close([moved.translation.x, moved.translation.y], [found.position.x, found.position.y], 0, "transform")
        assert moved.rotation == found.orientation
    (_, fixed), = by_topic["/tf_static", "tf2_msgs/msg/TFMessage"]
    (fixed,) = fixed.transforms
    assert (fixed.header.frame_id, fixed.child_frame_id) == ("base_link", "radar")
    assert qualities["/tf_static"] == "TRANSIENT_LOCAL" and qualities["/odom"] == "VOLATILE", qualities
    figures = {"odometry": len(odometry), "topics": sorted(topic for topic, _ in by_topic)}
    for (topic, _), messages in by_topic.items():
        if topic.endswith("b_scan_msg"):
            for _, message in messages:
                image = message.b_scan_img
                assert image.data.size == image.height * image.step and image.encoding == "8UC1"
                assert len(message.encoder_values) == len(message.timestamps) == image.height
                assert list(message.encoder_values) == sorted(message.encoder_values)
            figures["b_scans"] = len(messages)
        if topic == "/map":
            (_, grid), = messages
            assert grid.data.size == grid.info.width * grid.info.height and set(numpy.unique(grid.data)) <= {-1, 0, 100}
            assert (grid.data == 100).any() and grid.header.frame_id == "map"
    if ("/objects", "vision_msgs/msg/Detection3DArray") in by_topic:
        markers = by_topic["/object_markers", "visualization_msgs/msg/MarkerArray"]
        figures["objects"] = check_objects(by_topic["/objects", "vision_msgs/msg/Detection3DArray"], markers, out)
    figures["predicted"] = sum(row["outcome"] == "predicted" for row in rows)
    if sys.argv[3:]:
        check_turned(bag, Path(sys.argv[3]))
    print(json.dumps(figures))


main()
