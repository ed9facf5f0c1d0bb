"""A recording through the whole graph: player, pose_ingest, fisher_scorer, curator, and the trainer where it is wanted.

    ros2 launch contact_curation replay.launch.py bag:=session.mcap rate:=5.0 folder:=results
    ros2 launch contact_curation replay.launch.py bag:=session.mcap train:=true

With your own tracker instead of a recording, leave `bag` empty. Without the trainer theta stays, and the buffer is what
`contact-curation rank` gives. An argument that is empty sets nothing, so that the parameter file counts.
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
FILED = "; empty: as params_file has it"


def generate_launch_description() -> LaunchDescription:
    """The nodes, their parameter file, and where they keep what they know."""
    default_file = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "nodes.yaml"])
    arguments = [
        DeclareLaunchArgument("bag", default_value="", description="recording to play; empty: poses come live"),
        DeclareLaunchArgument("rate", default_value="", description=f"recorded seconds a second{FILED}"),
        DeclareLaunchArgument("folder", default_value=".", description="folder that the stores are kept in, made if need be"),
        DeclareLaunchArgument(
            "train", default_value="false", description="train on the selected tosses, and rank with the trained parameters"
        ),
        DeclareLaunchArgument(
            "params_file", default_value=default_file, description="parameters of the nodes that no argument sets"
        ),
        DeclareLaunchArgument("namespace", default_value="", description="namespace that holds all nodes and topics"),
        DeclareLaunchArgument(
            "use_sim_time", default_value="", description=f"time from the topic clock of the namespace{FILED}"
        ),
        DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn or error"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_make_folder), OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[Node]:
    sim_time = _given(context, "use_sim_time", "use_sim_time", bool)
    more = {"pose_ingest": _given(context, "rules_of", "bag", str)}
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
                    "store": ParameterValue(PathJoinSubstitution([LaunchConfiguration("folder"), store]), value_type=str),
                    **sim_time,
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
                **_given(context, "bag", "bag", str),  # a bag named 123 is no number
                **_given(context, "rate", "rate", float),
                "wait_for": 10.0,
                "stay": True,
            },
        ],
    )
    return [*stages, player]


def _given(context: LaunchContext, parameter: str, argument: str, kind: type) -> dict[str, object]:
    """The parameter that an argument sets, unless it is empty."""
    value = LaunchConfiguration(argument)
    return {parameter: ParameterValue(value, value_type=kind)} if value.perform(context) else {}


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
