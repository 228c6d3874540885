"""Publishes a radar's azimuths and its configuration in ROS 2, as Navtech's driver does.

Arguments: the domain, the address of the radar, and whether the configuration is published (`configured` or `silent`). The radar is asked for
azimuths once somebody subscribes to them, who has a second for the configuration.
"""

import os
import socket
import struct
import sys
import time

import ros
from cyclonedds.pub import DataWriter

SIGNATURE = bytes.fromhex("000103030707 0f0f1f1f3f3f7f7ffefe".replace(" ", ""))
CONFIGURATION, REQUEST_CONFIGURATION, START, AZIMUTH = 10, 20, 21, 30

domain, address, publishes = int(sys.argv[1]), sys.argv[2], sys.argv[3] == "configured"
participant, kept = ros.join(domain)
# As the driver keeps them: an azimuth each of a turn.
azimuths = DataWriter(participant, ros.topic(participant, "radar_data/fft_data", ros.RadarFftDataMsg, depth=400), qos=ros.qos(400))
configurations = DataWriter(
    participant, ros.topic(participant, "radar_data/configuration_data", ros.RadarConfigurationMsg, depth=1), qos=ros.qos(1)
)
host, port = address.split(":")
radar = socket.create_connection((host, int(port)))
stream = radar.makefile("rb")


def ask(kind):
    radar.sendall(SIGNATURE + struct.pack(">BBI", 1, kind, 0))


def receive():
    head = stream.read(22)
    if len(head) < 22:
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
    if publishes:
        configurations.write(ros.RadarConfigurationMsg(now(), samples, counts, 0, float(bin_size), bins, rotation, gain, offset))


print("ready", flush=True)
while not azimuths.get_matched_subscriptions():
    configure()
    time.sleep(0.1)
for _ in range(10):
    configure()
    time.sleep(0.1)
ask(START)
last, turns = 0, 0
while True:
    kind, payload = receive()
    if kind != AZIMUTH:
        continue
    first, counter, azimuth = struct.unpack(">3H", payload[:6])
    seconds, split = struct.unpack("<2I", payload[6:14])
    powers = payload[first:]
    # The driver's own angle is wrong too.
    angle = azimuth / samples * 360.0
    azimuths.write(ros.RadarFftDataMsg(now(), angle, azimuth, counter, seconds, split, powers, len(powers)))
    turns += azimuth <= last
    last = azimuth
    if turns >= 4:
        configure()
        turns = 0
