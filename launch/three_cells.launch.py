"""Three cells side by side, /cell1 to /cell3, each with a machine of its own.

ros2 launch lathe_chatter three_cells.launch.py supervisor:=shadow
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

CELL = str(Path(__file__).with_name('cell.launch.py'))
MACHINES = {'cell1': 'paper', 'cell2': 'chucked_shaft', 'cell3': 'boring_bar'}
ARGUMENTS = {
    'supervisor': ('', 'mode of each supervisor: shadow, ask or act; empty: none'),
    'use_sim_time': ('false', 'true: every node follows the /clock of another'),
    'params_file': ('', 'parameter file that every node is given; empty: none'),
}


def generate_launch_description() -> LaunchDescription:
    """The cells."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()
            ),
            *(
                IncludeLaunchDescription(
                    PythonLaunchDescriptionSource(CELL),
                    launch_arguments={
                        'namespace': name,
                        'machine': machine,
                        'output': '',
                        'page': '',  # there is one of each for all
                    }.items(),
                )
                for name, machine in MACHINES.items()
            ),
        ]
    )
