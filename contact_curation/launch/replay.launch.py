"""A recording through the whole graph: player, pose_ingest, fisher_scorer, curator, and the trainer where it is wanted.

    ros2 launch contact_curation replay.launch.py bag:=session.mcap rate:=5.0 folder:=results
    ros2 launch contact_curation replay.launch.py bag:=session.mcap train:=true

With your own tracker instead of a recording, leave `bag` empty. Without the trainer theta stays, and the buffer is what
`contact-curation rank` gives.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, NotEqualsSubstitution, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "contact_curation"
STORES = {
    "pose_ingest": "tosses.sqlite",
    "fisher_scorer": "information.sqlite",
    "curator": "buffer.sqlite",
    "trainer": "trainer.sqlite",
}
OPTIONAL = "trainer"


def generate_launch_description() -> LaunchDescription:
    """The nodes, their parameter file, and where they keep what they know."""
    default_file = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "nodes.yaml"])
    arguments = [
        DeclareLaunchArgument("bag", default_value="", description="recording to play; empty: poses come live"),
        DeclareLaunchArgument("rate", default_value="1.0", description="recorded seconds a second"),
        DeclareLaunchArgument("folder", default_value=".", description="folder that the stores are kept in, made if need be"),
        DeclareLaunchArgument(
            "train", default_value="false", description="train on the selected tosses, and rank with the trained parameters"
        ),
        DeclareLaunchArgument(
            "params_file", default_value=default_file, description="parameters of the nodes that no argument sets"
        ),
        DeclareLaunchArgument("namespace", default_value="", description="namespace that holds all nodes and topics"),
        DeclareLaunchArgument("use_sim_time", default_value="false", description="time from the topic clock of the namespace"),
        DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn or error"),
    ]
    bag = ParameterValue(LaunchConfiguration("bag"), value_type=str)  # a bag named 123 is no number
    more = {"pose_ingest": {"rules_of": bag}}
    stages = [
        Node(
            package=PACKAGE,
            executable=name,
            name=name,
            condition=IfCondition(LaunchConfiguration("train")) if name == OPTIONAL else None,
            **_everywhere(),
            parameters=[
                LaunchConfiguration("params_file"),
                {
                    "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool),
                    "store": ParameterValue(PathJoinSubstitution([LaunchConfiguration("folder"), store]), value_type=str),
                    **more.get(name, {}),
                },
            ],
        )
        for name, store in STORES.items()
    ]
    player = Node(
        package=PACKAGE,
        executable="player",
        name="player",
        **_everywhere(),
        condition=IfCondition(NotEqualsSubstitution(LaunchConfiguration("bag"), "")),
        parameters=[
            LaunchConfiguration("params_file"),
            {
                "bag": bag,
                "rate": ParameterValue(LaunchConfiguration("rate"), value_type=float),
                "wait_for": 10.0,
                "stay": True,
            },
        ],
    )
    return LaunchDescription([*arguments, OpaqueFunction(function=_make_folder), *stages, player])


def _everywhere() -> dict[str, object]:
    """What holds for every node."""
    return {
        "namespace": LaunchConfiguration("namespace"),
        "output": "screen",
        "remappings": [("/clock", "clock")],
        "arguments": ["--ros-args", "--log-level", LaunchConfiguration("log_level")],
    }


def _make_folder(context: LaunchContext) -> None:
    Path(LaunchConfiguration("folder").perform(context)).mkdir(parents=True, exist_ok=True)
