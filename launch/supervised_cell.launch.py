"""A cell with the operator's page and the supervisor.

ros2 launch lathe_chatter supervised_cell.launch.py mode:=ask
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CELL = str(Path(__file__).with_name('cell.launch.py'))


def generate_launch_description() -> LaunchDescription:
    """The cell, its page and its supervisor."""
    mode = LaunchConfiguration('mode')
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'mode', default_value='shadow', description='shadow, ask or act'
            ),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(CELL)),
            Node(package='lathe_chatter', executable='operator_page', output='screen'),
            Node(
                package='lathe_chatter',
                executable='chatter_supervisor',
                parameters=[{'mode': mode}],
                output='screen',
            ),
        ]
    )
