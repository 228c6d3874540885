"""An afternoon of a robot, in minutes: it boots before its radar, loses it, fills its log and its disk, is reset, killed and upgraded, starts in its map, and
each pose is accounted for at the end.

    unshare --map-root-user --mount afternoon.py GYRE FOLDER

prints a line for each event. FOLDER is empty, and gets a disk of its own. The radar is `gyre radar-server` with the demo; when it is started again its clock steps back."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time

gyre, folder = map(os.path.abspath, sys.argv[1:])
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1g", "none", folder], check=True)
os.chdir(folder)
began = time.monotonic()
out, config = f"{folder}/out", f"{folder}/robot.toml"
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    address = "127.0.0.1:%d" % free.getsockname()[1]
with open(config, "w") as file:
    file.write(f"""[run]
mode = "live"
rate = "realtime"
[source]
kind = "colossus"
address = "{address}"
[raster]
n = 127
cell_m = 1.6
[slam]
kind = "graph"
""")


def report(event, **figures):
    shown = "".join(f"  {name} {value}" for name, value in figures.items())
    print(f"{time.monotonic() - began:6.1f} s  {event}{shown}", flush=True)


def call(*words, code=0, program=None):
    ended = subprocess.run([program or gyre, *words], capture_output=True, text=True, cwd=folder)
    assert ended.returncode == code, (words, ended.returncode, ended.stdout, ended.stderr)
    return ended.stdout + ended.stderr


def up(program=None, *settings):
    """As the unit starts it: in its own session."""
    said = call("up", config, "--out", out, *settings, program=program)
    return said.strip().splitlines()[-1].replace(folder, "")


def status():
    [run] = json.loads(call("ps", out, "--json"))
    return run["status"]


def until(what, look, limit_s=60):
    since = time.monotonic()
    while time.monotonic() < since + limit_s:
        if look():
            return
        time.sleep(0.1)
    raise AssertionError(f"waited for {what}: {json.dumps(status())}")


def await_poses(more):
    poses = status()["poses"] + more
    until(f"{poses} poses", lambda: status()["poses"] >= poses)


radar = None


def radar_on():
    global radar
    radar = subprocess.Popen([gyre, "radar-server", "demo", "--listen", address, "--repeat", "--rate", "2"], stderr=subprocess.DEVNULL)


def radar_off():
    radar.terminate()
    radar.wait()


def finished(place):
    """The counts of a run that has ended: each scan is a pose, or counted as missing."""
    with open(f"{place}/summary.json") as file:
        summary = json.load(file)
    with open(f"{place}/trajectory.tum") as file:
        stamps = [float(line.split()[0]) for line in file]
    counts = {name: summary.get(name, 0) for name in ("published", "processed", "dropped", "breaks", "commands")}
    assert counts["processed"] == len(stamps), (place, counts, len(stamps))
    counts["steps back"] = sum(later < earlier for earlier, later in zip(stamps, stamps[1:]))
    assert counts["published"] == counts["processed"] + counts["dropped"], (place, counts)
    return counts


try:
    report("boots before its radar", says=up())
    assert status()["phase"] == "waiting-for-radar", status()
    radar_on()
    until("the first poses", lambda: status()["poses"] > 10)
    report("has its radar", poses=status()["poses"])

    radar_off()
    time.sleep(4)
    report("has lost its radar", phase=status()["phase"])
    radar_on()
    await_poses(10)
    report("has it again, with a clock that has stepped back", poses=status()["poses"])

    log = f"{out}/log.jsonl"
    with open(log, "r+") as file:
        lines = file.read()
        file.write(lines * ((9 << 20) // len(lines)))
    until("a short log", lambda: os.path.getsize(log) < 1 << 20)
    report("has turned its log over", kept=os.path.getsize(f"{log}.old"))

    filler = f"{folder}/filler"
    with open(filler, "wb", buffering=0) as file:
        for size in (1 << 20, 1 << 12, 1):
            try:
                while file.write(bytes(size)) == size:
                    pass
            except OSError:
                pass
    until("a full disk", lambda: status()["disk_is_full"])
    await_poses(10)
    report("continues on a full disk", poses=status()["poses"])
    os.remove(filler)
    until("room on the disk", lambda: not status()["disk_is_full"])
    report("has written what it held", poses=status()["poses"])

    report(call("reset", out, "--pose", "5,2,90", "--keep-map").strip())
    await_poses(5)
    report(call("new-map", out).strip())
    await_poses(40)

    supervisor = status()["pid"]
    for process in status()["processes"][:3]:
        os.kill(process["pid"], signal.SIGKILL)
    await_poses(5)
    os.kill(supervisor, signal.SIGKILL)
    time.sleep(2)
    report("all of it was killed", says=up())
    await_poses(10)
    poses = status()["poses"]
    assert poses > 60, poses
    report("continues from its journal", poses=poses)

    program = f"{folder}/gyre-new"
    shutil.copy(gyre, program)
    with open(program, "ab") as file:
        file.write(b"another build")
    report(call("down", out).strip().splitlines()[0])
    report("is upgraded", says=up(program))
    await_poses(60)
    [closed] = [name for name in os.listdir(folder) if name.startswith("out.")]
    counts = finished(f"{folder}/{closed}")
    assert counts["steps back"] > 0, counts
    report("the run before is closed", folder=closed, **counts)
    report(call("map", closed, "--format=folder", "--out", "map-before").strip())

    call("down", out)
    call("map", out, "--format=folder", "--out", f"{folder}/map")
    report("starts in its map", says=up(program, "--set", f"slam.map={folder}/map"))
    until("poses", lambda: status()["poses"] > 10)
    report(call("locate", out, "--pose", "0,0,0", "--sigma", "20,90", program=program).strip())
    await_poses(20)
    call("down", out)
    places = sorted(name for name in os.listdir(folder) if name.startswith("out"))
    for place in places:
        report(f"the end of {place}", **finished(f"{folder}/{place}"))
finally:
    subprocess.run([gyre, "down", out], capture_output=True)
    if radar:
        radar.kill()
