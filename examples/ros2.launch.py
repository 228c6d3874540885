"""A launch file of ROS 2 that publishes a run, with the names of its frames:

    ros2 launch examples/ros2.launch.py out:=out/robot base_frame:=base_footprint

It needs `gyre` with ROS 2 on the PATH. The parameters have the names of kiss-icp.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PARAMETERS = {
    "base_frame": "base_link",
    "lidar_odom_frame": "odom",
    "map_frame": "map",
    "radar_frame": "radar",
    "publish_odom_tf": "true",
}
ARGUMENTS = {
    "out": "out/radar",  # the folder of the run
    "namespace": "/",
    "mounting": "0,0,0",  # of the radar on the vehicle: m forward, m to the left, degrees counter-clockwise
    "tf_ahead_s": "0.3",  # map -> odom is valid until the next pose
}


def generate_launch_description():
    of = LaunchConfiguration
    parameters = [word for name in PARAMETERS for word in ("-p", [f"{name}:=", of(name)])]
    options = ["--wait", "--mounting", of("mounting"), "--tf-ahead-s", of("tf_ahead_s")]
    node = Node(
        executable="gyre",
        name="gyre",
        namespace=of("namespace"),
        arguments=["ros2", of("out"), *options],
        ros_arguments=parameters,
        output="screen",
    )
    arguments = (PARAMETERS | ARGUMENTS).items()
    return LaunchDescription([*(DeclareLaunchArgument(name, default_value=value) for name, value in arguments), node])
