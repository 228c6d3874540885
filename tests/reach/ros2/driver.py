"""Publishes a radar in ROS 2, as Navtech's driver does.

Arguments: the domain, the address of the radar, and what is published: azimuths and the configuration (`configured`), azimuths alone (`silent`), both
with numbers as bytes, as until 2024 (`older`), turns and the configuration (`turns`), or turns alone (`silent-turns`). The radar is asked for azimuths
once somebody subscribes to them, who has a second for the configuration. Further arguments are the logs of a gyro, of
wheels and of a GNSS receiver, which are published beside the azimuths by their stamps.
"""

import os
import signal
import socket
import struct
import sys
import time

import ros
from cyclonedds.pub import DataWriter

SIGNATURE = bytes.fromhex("000103030707 0f0f1f1f3f3f7f7ffefe".replace(" ", ""))
CONFIGURATION, REQUEST_CONFIGURATION, START, AZIMUTH = 10, 20, 21, 30

domain, address, publishes = int(sys.argv[1]), *sys.argv[2:4]
rows, speeds, fixes = ([line.split(",") for line in open(log).read().splitlines()[1:]] for log in (sys.argv[4:] + [os.devnull] * 3)[:3])
is_silent, in_turns = publishes.startswith("silent"), publishes.endswith("turns")
AZIMUTHS, CONFIGURATIONS = {
    "turns": (ros.RadarBScanMsg, ros.RadarConfigurationMsg),
    "silent-turns": (ros.RadarBScanMsg, ros.RadarConfigurationMsg),
    "older": (ros.RadarFftDataMessage, ros.RadarConfigurationMessage),
}.get(publishes, (ros.RadarFftDataMsg, ros.RadarConfigurationMsg))
# Ctrl-C ends it without a traceback.
signal.signal(signal.SIGINT, signal.SIG_DFL)
participant, kept = ros.join(domain)
# As the driver keeps them: an azimuth each of a turn.
name = "radar_data/b_scan_msg" if in_turns else "radar_data/fft_data"
scans = DataWriter(participant, ros.topic(participant, name, AZIMUTHS, depth=400), qos=ros.qos(400))
configurations = DataWriter(participant, ros.topic(participant, "radar_data/configuration_data", CONFIGURATIONS, depth=1), qos=ros.qos(1))
gyro = DataWriter(participant, ros.topic(participant, "imu/data", ros.Imu, depth=100), qos=ros.best_effort(100)) if rows else None
wheels = DataWriter(participant, ros.topic(participant, "odom", ros.Odometry, depth=100), qos=ros.qos(100)) if speeds else None
gnss = DataWriter(participant, ros.topic(participant, "fix", ros.NavSatFix, depth=100), qos=ros.qos(100)) if fixes else None
host, port = address.split(":")
radar = socket.create_connection((host, int(port)))
stream = radar.makefile("rb")


def ask(kind):
    radar.sendall(SIGNATURE + struct.pack(">BBI", 1, kind, 0))


def receive(at_end=None):
    head = stream.read(22)
    if len(head) < 22:
        if at_end:
            at_end()
        # What was written last is on its way.
        time.sleep(2)
        sys.exit(0)
    kind, size = struct.unpack(">xBI", head[16:])
    return kind, stream.read(size)


def now():
    ns = time.time_ns()
    return ros.Header(ros.Time(ns // 10**9, ns % 10**9), "")


ask(REQUEST_CONFIGURATION)
kind, payload = receive()
while kind != CONFIGURATION:
    kind, payload = receive()
samples, bin_size, bins, counts, rotation, _ = struct.unpack(">6H", payload[:12])
gain, offset = struct.unpack(">2f", payload[12:20])


def configure():
    if publishes == "older":
        numbers = [struct.pack(">H", number) for number in (samples, counts, bins, rotation)]
        # The driver copies the double as its computer has it.
        numbers.insert(2, struct.pack("<d", float(bin_size)))
        configurations.write(ros.RadarConfigurationMessage(now(), *numbers))
    elif not is_silent:
        configurations.write(ros.RadarConfigurationMsg(now(), samples, counts, 0, float(bin_size), bins, rotation, gain, offset))


class Turn:
    """The azimuths of a turn, each in the row of its encoder count."""

    def __init__(self):
        self.powers, self.encoders, self.stamps = bytearray(samples * bins), [0] * samples, [0] * samples

    def add(self, azimuth, stamp_ns, powers):
        row = azimuth // (counts // samples)
        if row < samples:
            self.powers[row * bins : row * bins + len(powers)] = powers
            self.encoders[row], self.stamps[row] = azimuth, stamp_ns

    def publish(self):
        image = ros.Image(now(), samples, bins, "8UC1", 0, bins, bytes(self.powers))
        scans.write(ros.RadarBScanMsg(image, self.encoders, self.stamps))


def measure(until_ns):
    while speeds and int(speeds[0][0]) <= until_ns:
        stamp, speed = speeds.pop(0)
        stamp, at_rest = int(stamp), ros.Vector3(0.0, 0.0, 0.0)
        header = ros.Header(ros.Time(stamp // 10**9, stamp % 10**9), "odom")
        pose = ros.PoseWithCovariance(ros.Pose(ros.Point(0.0, 0.0, 0.0), ros.Quaternion(0.0, 0.0, 0.0, 1.0)), [0.0] * 36)
        twist = ros.TwistWithCovariance(ros.Twist(ros.Vector3(float(speed), 0.0, 0.0), at_rest), [0.0] * 36)
        wheels.write(ros.Odometry(header, "base_link", pose, twist))
    while fixes and int(fixes[0][0]) <= until_ns:
        stamp, latitude, longitude, sigma_m = fixes.pop(0)
        stamp, variance = int(stamp), float(sigma_m) ** 2
        header, status = ros.Header(ros.Time(stamp // 10**9, stamp % 10**9), "gnss"), ros.NavSatStatus(0, 1)
        covariance = [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, 4 * variance]
        gnss.write(ros.NavSatFix(header, status, float(latitude), float(longitude), 0.0, covariance, 2))
    while rows and int(rows[0][0]) <= until_ns:
        stamp, *values = rows.pop(0)
        stamp, values = int(stamp), [float(value) for value in values]
        header = ros.Header(ros.Time(stamp // 10**9, stamp % 10**9), "imu")
        turn, along = ros.Vector3(*values[:3]), ros.Vector3(*values[3:])
        gyro.write(ros.Imu(header, ros.Quaternion(0.0, 0.0, 0.0, 1.0), [0.0] * 9, turn, [0.0] * 9, along, [0.0] * 9))


print("ready", flush=True)
# Who asks for the configuration before a run subscribes too, and leaves.
matched = 0
while matched < 10:
    matched = matched + 1 if scans.get_matched_subscriptions() else 0
    configure()
    time.sleep(0.1)
ask(START)
last, turns, turn = 0, 0, Turn()
while True:
    kind, payload = receive(at_end=turn.publish if in_turns else None)
    if kind != AZIMUTH:
        continue
    first, counter, azimuth = struct.unpack(">3H", payload[:6])
    seconds, split = struct.unpack("<2I", payload[6:14])
    powers = payload[first:]
    # It is a little ahead of the radar, so that no scan waits.
    measure(seconds * 10**9 + split + 30_000_000)
    if in_turns:
        if azimuth <= last:
            turn.publish()
            turn = Turn()
        # The driver's own times are rounded to 256 ns.
        turn.add(azimuth, seconds * 10**9 + split, powers)
    elif publishes == "older":
        numbers = payload[4:6], payload[2:4], payload[6:10], payload[10:14]
        scans.write(ros.RadarFftDataMessage(now(), bytes(8), *numbers, powers, struct.pack(">H", len(powers))))
    else:
        # The driver's own angle is wrong too.
        angle = azimuth / samples * 360.0
        scans.write(ros.RadarFftDataMsg(now(), angle, azimuth, counter, seconds, split, powers, len(powers)))
    turns += azimuth <= last
    last = azimuth
    if turns >= 4:
        configure()
        turns = 0
