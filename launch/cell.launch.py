"""A cell: lathe, monitor and recorder, in a namespace.

ros2 launch lathe_chatter cell.launch.py namespace:=cell1 machine:=chucked_shaft
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    'namespace': ('', 'of the cell; empty: none'),
    'machine': ('', 'machine file, or the name of one that is shipped; empty: the parameters'),
    'output': ('', 'folder of the run; empty: runs/<date-time>'),
}


def generate_launch_description() -> LaunchDescription:
    """The cell."""
    machine = ParameterValue(LaunchConfiguration('machine'), value_type=str)
    output = ParameterValue(LaunchConfiguration('output'), value_type=str)
    namespace = LaunchConfiguration('namespace')
    nodes = {
        'lathe': {'machine': machine},
        'chatter_monitor': {'machine': machine},
        'run_recorder': {'output': output},
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()
            ),
            *(
                Node(
                    package='lathe_chatter',
                    executable=executable,
                    namespace=namespace,
                    parameters=[parameters],
                    output='screen',
                )
                for executable, parameters in nodes.items()
            ),
        ]
    )
