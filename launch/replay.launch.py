"""A recorded run played again, and a monitor that judges it.

ros2 launch lathe_chatter replay.launch.py run:=runs/today
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """The player, of the samples alone, and the monitor."""
    return LaunchDescription(
        [
            DeclareLaunchArgument('run', description='folder of the run'),
            DeclareLaunchArgument('rate', default_value='1.0', description='of the playback'),
            Node(package='lathe_chatter', executable='chatter_monitor', output='screen'),
            ExecuteProcess(
                cmd=[
                    *('ros2', 'bag', 'play', LaunchConfiguration('run')),
                    *('--rate', LaunchConfiguration('rate'), '--topics', '/lathe/samples'),
                ],
                output='screen',
            ),
        ]
    )
