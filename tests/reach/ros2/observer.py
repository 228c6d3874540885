"""Prints the messages of a run for which `node.py` lacks packages, a line of JSON a message, until its input ends.

Arguments: the domain, the namespace, and topics that nobody publishes. The first line is `{"ready": true}` once publishers of all others are there.
"""

import json
import sys
import threading
import time
from dataclasses import asdict

import ros
from cyclonedds.sub import DataReader

domain, namespace, absent = int(sys.argv[1]), sys.argv[2].rstrip("/"), sys.argv[3:]
participant, kept = ros.join(domain)
readers = {
    name: DataReader(participant, ros.topic(participant, name, kind, **keep), qos=ros.qos(**keep))
    for name, kind, keep in [
        ("/tf", ros.TFMessage, {"depth": 1000}),
        ("/tf_static", ros.TFMessage, {"latched": True}),
        (namespace + "/objects", ros.Detection3DArray, {"depth": 1000}),
    ]
}
asked = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), asked.set()), daemon=True).start()


def take():
    for name, reader in readers.items():
        for message in reader.take(N=1000):
            print(json.dumps({"topic": name, "message": asdict(message)}))
    sys.stdout.flush()


awaited = [reader for name, reader in readers.items() if name not in absent]
while any(not reader.get_matched_publications() for reader in awaited) and not asked.is_set():
    time.sleep(0.02)
print(json.dumps({"ready": True}), flush=True)
while not asked.is_set():
    take()
    time.sleep(0.02)
# What is under way.
time.sleep(1.0)
take()
