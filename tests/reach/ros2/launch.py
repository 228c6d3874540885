"""Prints the words with which a launch file starts its node, a line each, as launch_ros arranges them. Argument: the launch file."""

import runpy
import sys
from types import ModuleType, SimpleNamespace

DEFAULTS = {}


def expand(word):
    return word if isinstance(word, str) else "".join(map(expand, word)) if isinstance(word, list) else DEFAULTS[word.name]


def provide(module, **members):
    sys.modules[module] = ModuleType(module)
    vars(sys.modules[module]).update(members)


provide("launch", LaunchDescription=lambda entities: entities)
provide("launch.actions", DeclareLaunchArgument=lambda name, default_value: DEFAULTS.update({name: default_value}))
provide("launch.substitutions", LaunchConfiguration=lambda name: SimpleNamespace(name=name))
provide("launch_ros")
provide("launch_ros.actions", Node=SimpleNamespace)
*_, node = runpy.run_path(sys.argv[1])["generate_launch_description"]()
names = ["-r", "__node:=" + node.name, "-r", ["__ns:=", node.namespace]]
for word in [node.executable, *node.arguments, "--ros-args", *node.ros_arguments, "--ros-args", *names]:
    print(expand(word))
