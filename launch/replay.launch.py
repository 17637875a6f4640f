"""A recorded run played again, and a monitor that judges it.

ros2 launch lathe_chatter replay.launch.py run:=runs/today
"""

import yaml
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    'run': (None, 'folder of the run'),
    'rate': ('1.0', 'of the playback'),
    'namespace': ('', 'of the recorded lathe and of the monitor; empty: none'),
    'use_sim_time': ('false', 'true: the player drives /clock, and the monitor follows it'),
    'params_file': ('', 'parameter file that the monitor is given; empty: none'),
}


def _player_and_monitor(context: LaunchContext) -> list[ExecuteProcess]:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    samples = f'/{given["namespace"].strip("/")}/lathe/samples'.replace('//', '/')
    clock = given['use_sim_time']
    return [
        Node(
            package='lathe_chatter',
            executable='chatter_monitor',
            name='chatter_monitor',
            namespace=given['namespace'],
            parameters=[
                *([given['params_file']] if given['params_file'] else []),
                {'use_sim_time': yaml.safe_load(clock)},
            ],
            output='screen',
        ),
        ExecuteProcess(
            cmd=[
                *('ros2', 'bag', 'play', given['run'], '--rate', given['rate']),
                *('--topics', samples),
                *(['--clock'] if clock.lower() != 'false' else []),
            ],
            output='screen',
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """The player, of the samples alone, and the monitor."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=_player_and_monitor),
        ]
    )
