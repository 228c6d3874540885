"""A node of ROS 2 (rclpy): prints what it receives of a run, a line of JSON a message, until its input ends.

Arguments: the namespace of the run, and `sim` for a node with `use_sim_time`. Domain and network are those of ROS_DOMAIN_ID and
ROS_AUTOMATIC_DISCOVERY_RANGE. The first line is `{"ready": true}` once there is odometry; a line `lifecycle` of the input takes a managed node
through its states, a line `commands` gives the run a pose, a new map and a reset, and `meanwhile` asks
for a state while a command waits. Odometry is also read as sensor data is, on the topic `sensor`; the topic `now` has the time of the node at each of its messages.
"""

import json
import select
import sys
import time
from itertools import groupby

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

namespace, is_simulated = sys.argv[1].rstrip("/"), sys.argv[2:] == ["sim"]
rclpy.init()
node = rclpy.create_node("observer", parameter_overrides=[Parameter("use_sim_time", value=is_simulated)])
KEPT = QoSProfile(depth=1000)
# As sensor data is read, but for its depth of 5.
LOSSY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def plain(value):
    """A message as JSON, the cells of a map as pairs of a value and how often it follows."""
    if isinstance(value, OccupancyGrid):
        cells = [(cell & 255, len(list(cells))) for cell, cells in groupby(value.data)]
        value.data = []
        return plain_fields(value) | {"data": cells}
    if hasattr(value, "get_fields_and_field_types"):
        return plain_fields(value)
    if isinstance(value, bytes):
        return value[0]
    return value if isinstance(value, (str, int, float)) else [plain(part) for part in value]


def plain_fields(message):
    return {name: plain(getattr(message, name)) for name in message.get_fields_and_field_types()}


early, newest = [], 0.0


def show(topic, message):
    line = json.dumps({"topic": topic, "message": message})
    early.append(line) if early is not None else print(line, flush=True)


def show_now():
    show("now", node.get_clock().now().nanoseconds)


def subscribe(kind, name, qos=KEPT, topic=None):
    def receive(message):
        global newest
        if kind is not DiagnosticArray:
            newest = time.monotonic()
        show(topic or name, plain(message))
        if kind is Odometry:
            show_now()

    node.create_subscription(kind, name, receive, qos)


odometry = namespace + "/odom"
subscribe(Odometry, odometry)
subscribe(Odometry, odometry, LOSSY, "sensor")
subscribe(DiagnosticArray, "/diagnostics")
subscribe(MarkerArray, namespace + "/object_markers")
subscribe(PoseWithCovarianceStamped, namespace + "/map_fix")
subscribe(TwistWithCovarianceStamped, namespace + "/doppler")
subscribe(OccupancyGrid, namespace + "/map", LATCHED)
subscribe(Clock, "/clock", LOSSY)
subscribe(TransitionEvent, namespace + "/gyre/transition_event")


clients = {}


def call(kind, name, **fields):
    client = clients.get(name) or clients.setdefault(name, node.create_client(kind, f"{namespace}/gyre/{name}"))
    assert client.wait_for_service(10), name
    return client.call_async(kind.Request(**fields))


def ask(kind, name, **fields):
    answer = call(kind, name, **fields)
    rclpy.spin_until_future_complete(node, answer, timeout_sec=10)
    show(name, plain(answer.result()))


def take_through_states():
    ask(GetAvailableStates, "get_available_states")
    for change in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        ask(ChangeState, "change_state", transition=Transition(id=change))
        ask(GetState, "get_state")
        ask(GetAvailableTransitions, "get_available_transitions")


def give_commands():
    poses = node.create_publisher(PoseWithCovarianceStamped, namespace + "/initialpose", 1)
    while not poses.get_subscription_count():
        spin(0.02)
    pose = PoseWithCovarianceStamped()
    pose.header.frame_id = "map"
    pose.pose.pose.position.x, pose.pose.pose.position.y = 40.0, -30.0
    pose.pose.pose.orientation.w = 1.0
    poses.publish(pose)
    spin(1.0)
    ask(Trigger, "new_map")
    ask(Trigger, "reset")


def ask_meanwhile():
    waiting = call(Trigger, "new_map")
    ask(GetState, "get_state")
    show("still waits", not waiting.done())


def spin(duration_s):
    until = time.monotonic() + duration_s
    while time.monotonic() < until:
        rclpy.spin_once(node, timeout_sec=0.02)


while not node.count_publishers(odometry):
    spin(0.02)
# A publisher that was found is not yet matched.
spin(0.5)
lines, early = early, None
print(json.dumps({"ready": True}), *lines, sep="\n", flush=True)
while True:
    spin(0.02)
    if select.select([sys.stdin], [], [], 0)[0]:
        line = sys.stdin.readline().strip()
        if not line:
            break
        {"lifecycle": take_through_states, "commands": give_commands, "meanwhile": ask_meanwhile}[line]()
newest = time.monotonic()
# What is under way: a map takes a second.
while time.monotonic() < newest + 2.0:
    spin(0.1)
show_now()
