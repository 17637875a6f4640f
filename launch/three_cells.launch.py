"""Three cells side by side, /cell1 to /cell3, each with a machine of its own.

ros2 launch lathe_chatter three_cells.launch.py
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

CELL = str(Path(__file__).with_name('cell.launch.py'))
MACHINES = {'cell1': 'paper', 'cell2': 'chucked_shaft', 'cell3': 'boring_bar'}


def generate_launch_description() -> LaunchDescription:
    """The cells."""
    return LaunchDescription(
        [
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(CELL),
                launch_arguments={
                    'namespace': name,
                    'machine': machine,
                    'output': f'runs/{name}',
                }.items(),
            )
            for name, machine in MACHINES.items()
        ]
    )
