"""Prints what a node of ROS 2 receives of a run, a line of JSON a message, until its input ends.

Arguments: the domain, the namespace. The first line is `{"ready": true}` once publishers of all topics are there.
"""

import json
import sys
import threading
import time
from dataclasses import asdict

import ros
from cyclonedds.sub import DataReader

domain, namespace = int(sys.argv[1]), sys.argv[2].rstrip("/")
participant, kept = ros.join(domain)
readers = {
    name: DataReader(participant, ros.topic(participant, name, kind, **keep), qos=ros.qos(**keep))
    for name, kind, keep in [
        (namespace + "/odom", ros.Odometry, {"depth": 1000}),
        ("/tf", ros.TFMessage, {"depth": 1000}),
        ("/tf_static", ros.TFMessage, {"latched": True}),
        ("/diagnostics", ros.DiagnosticArray, {}),
        (namespace + "/map", ros.OccupancyGrid, {"depth": 1, "latched": True}),
    ]
}
asked = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), asked.set()), daemon=True).start()


def plain(message):
    """The message as JSON, of a map only which values its cells have."""
    fields = asdict(message)
    if isinstance(message, ros.OccupancyGrid):
        cells = bytes(message.data)
        fields["data"] = {str(value): cells.count(value) for value in set(cells)}
    return fields


def take():
    for name, reader in readers.items():
        for message in reader.take(N=1000):
            print(json.dumps({"topic": name, "message": plain(message)}))
    sys.stdout.flush()


while any(not reader.get_matched_publications() for reader in readers.values()) and not asked.is_set():
    time.sleep(0.02)
print(json.dumps({"ready": True}), flush=True)
while not asked.is_set():
    take()
    time.sleep(0.02)
# What is under way.
time.sleep(1.0)
take()
