"""ros2 launch cfem_ros controller.launch.py model:=/abs/models/soft-finger/spectral"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    named = {
        "model": ("", "folder of cfem train or cfem export"),
        "device": ("['']", "words of the program that drives the robot, by the pipe protocol; none: it is on topics"),
        "frame": ("robot", "frame of goals and of the measured effector: that of the scene"),
        "rate": ("20.0", "ticks per second"),
    }
    arguments = [DeclareLaunchArgument(name, default_value=one, description=say) for name, (one, say) in named.items()]
    parameters = [{name: LaunchConfiguration(name) for name in named}]
    return LaunchDescription(
        [*arguments, Node(package="cfem_ros", executable="controller", name="cfem", parameters=parameters)]
    )
