"""A cell with the page for an operator and the supervisor; takes the arguments of a cell too.

ros2 launch lathe_chatter supervised_cell.launch.py mode:=ask
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

CELL = str(Path(__file__).with_name('cell.launch.py'))
ARGUMENTS = {
    'mode': ('shadow', 'mode of the supervisor: shadow, ask or act'),
    'page': ('8080', 'port of the page'),
}


def generate_launch_description() -> LaunchDescription:
    """The cell, its page and its supervisor."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(CELL),
                launch_arguments={'supervisor': LaunchConfiguration('mode')}.items(),
            ),
        ]
    )
