"""A cell: lathe, monitor and recorder, and where asked for the supervisor and the page.

ros2 launch lathe_chatter cell.launch.py namespace:=cell1 machine:=chucked_shaft
"""

import yaml
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    'namespace': ('', 'of every node; empty: none'),
    'machine': ('', 'machine file, or the name of one that is shipped; empty: the parameters'),
    'output': ('', 'folder of the run; empty: runs/<date-time>'),
    'supervisor': ('', 'mode of the supervisor: shadow, ask or act; empty: none'),
    'page': ('', 'port of the page for an operator; empty: none'),
    'use_sim_time': ('false', 'true: every node follows the /clock of another'),
    'params_file': ('', 'parameter file that every node is given; empty: none'),
}
PARAMETERS = {
    'lathe': {'machine': 'machine'},
    'chatter_monitor': {'machine': 'machine'},
    'run_recorder': {'output': 'output'},
    'chatter_supervisor': {'mode': 'supervisor'},
    'operator_page': {'port': 'page'},
}
"""By node: its parameters, and the arguments that they come from."""
OPTIONAL = {'chatter_supervisor', 'operator_page'}


def _nodes(context: LaunchContext) -> list[Node]:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    nodes = []
    for executable, origins in PARAMETERS.items():
        chosen = {name: given[origin] for name, origin in origins.items() if given[origin]}
        if executable in OPTIONAL and not chosen:
            continue
        parameters = {
            name: int(value) if name == 'port' else ParameterValue(value, value_type=str)
            for name, value in chosen.items()
        }
        if given['use_sim_time'].lower() != 'false':
            parameters['use_sim_time'] = yaml.safe_load(given['use_sim_time'])
        files = [given['params_file']] if given['params_file'] else []
        nodes.append(
            Node(
                package='lathe_chatter',
                executable=executable,
                name=executable,
                namespace=given['namespace'],
                parameters=[*files, parameters],
                output='screen',
            )
        )
    return nodes


def generate_launch_description() -> LaunchDescription:
    """The cell."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=_nodes),
        ]
    )
