"""The whole graph, closed to a loop: throws are designed, made by the simulated arm, tracked, scored, curated, and trained on.

    ros2 launch contact_curation online.launch.py folder:=results
    ros2 launch contact_curation online.launch.py throws:=12 rate:=0.0 dashboard:=true record:=true
    ros2 launch contact_curation online.launch.py camera:=rendered tag_map:=cube_tags.yaml

With an arm or a tracker of your own, leave out what stands for it: arm:=false thrower:=none, or camera:=none. With auto:=false
throws are designed on request alone. Nodes that die are started again. `contact-curation online` does the same without ROS's
launch, and ends with a summary and a report.

An argument that is empty sets nothing, so that the parameter file counts.
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
    "throw_designer": "throws.sqlite",
}
SET_BY: dict[str, dict[str, tuple[str, type]]] = {
    "pose_ingest": {"topic": ("topic", str), "tag_map": ("tag_map", str)},
    "throw_designer": {"auto": ("auto", bool), "max_throws": ("throws", int), "thrower": ("thrower", str)},
    "sim_arm": {"rate": ("rate", float)},
    "sim_camera": {"mode": ("camera", str), "tag_map": ("tag_map", str)},
}
"""Arguments, with their types, that set parameters of nodes, by node and parameter."""

FILED = "; empty: as params_file has it"
RESTART_DELAY = 1.0
"""[s]"""


def generate_launch_description() -> LaunchDescription:
    """The nodes, their parameter file, and where they keep what they know."""
    default_file = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "nodes.yaml"])
    arguments = [
        DeclareLaunchArgument(
            "folder", default_value=".", description="folder that stores and recordings are kept in, made if need be"
        ),
        DeclareLaunchArgument("throws", default_value="", description=f"no more throws than these; 0: no end{FILED}"),
        DeclareLaunchArgument(
            "rate", default_value="", description=f"simulated seconds per second; 0: as fast as possible{FILED}"
        ),
        DeclareLaunchArgument("arm", default_value="true", description="the simulated arm throws"),
        DeclareLaunchArgument("thrower", default_value="arm", description="who makes the throws: arm; none: one of your own"),
        DeclareLaunchArgument("auto", default_value="true", description="throw after throw, without being asked"),
        DeclareLaunchArgument("camera", default_value="", description=f"the simulated camera: poses, rendered, or none{FILED}"),
        DeclareLaunchArgument(
            "topic", default_value="", description=f"the body's poses; auto: found by the name of the body{FILED}"
        ),
        DeclareLaunchArgument(
            "tag_map", default_value="", description=f"tags of body and board, which camera:=rendered needs{FILED}"
        ),
        DeclareLaunchArgument("dashboard", default_value="false", description="serve the dashboard to a browser"),
        DeclareLaunchArgument("record", default_value="false", description="record all topics into session.mcap"),
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
    stages = [_node(context, name, {"store": _in_folder(store)}) for name, store in STORES.items()]
    camera = IfCondition(NotEqualsSubstitution(LaunchConfiguration("camera"), "none"))
    return [
        *stages,
        _node(
            context, "sim_arm", {"armed": True, "state": _in_folder("sim_arm.json")}, IfCondition(LaunchConfiguration("arm"))
        ),
        _node(context, "sim_camera", {}, camera),
        _node(context, "dashboard", {}, IfCondition(LaunchConfiguration("dashboard"))),
        _node(context, "session_recorder", {"bag": _in_folder("session.mcap")}, IfCondition(LaunchConfiguration("record"))),
    ]


def _node(context: LaunchContext, name: str, parameters: dict[str, object], condition: IfCondition | None = None) -> Node:
    """A node with parameters, and with those that arguments set which are not empty."""
    set_by = {"use_sim_time": ("use_sim_time", bool), **SET_BY.get(name, {})}
    given = {
        parameter: ParameterValue(LaunchConfiguration(argument), value_type=kind)
        for parameter, (argument, kind) in set_by.items()
        if LaunchConfiguration(argument).perform(context)
    }
    own = {**parameters, **given}
    return Node(
        package=PACKAGE,
        executable=name,
        name=name,
        output="screen",
        namespace=LaunchConfiguration("namespace"),
        condition=condition,
        respawn=True,
        respawn_delay=RESTART_DELAY,
        remappings=[("/clock", "clock")],
        arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
        parameters=[LaunchConfiguration("params_file"), *([own] if own else [])],
    )


def _in_folder(name: str) -> ParameterValue:
    return ParameterValue(PathJoinSubstitution([LaunchConfiguration("folder"), name]), value_type=str)


def _make_folder(context: LaunchContext) -> None:
    Path(LaunchConfiguration("folder").perform(context)).mkdir(parents=True, exist_ok=True)
