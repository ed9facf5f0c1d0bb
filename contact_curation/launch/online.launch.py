"""The whole graph, closed to a loop: throws are designed, made by the simulated arm, tracked, scored, curated, and trained on.

    ros2 launch contact_curation online.launch.py folder:=results
    ros2 launch contact_curation online.launch.py throws:=12 rate:=0.0 dashboard:=true record:=true
    ros2 launch contact_curation online.launch.py camera:=rendered tag_map:=cube_tags.yaml

With an arm or a tracker of your own, leave out what stands for it: arm:=false thrower:=none, or camera:=none. With auto:=false
throws are designed on request alone. Nodes that die are started again. `contact-curation online` does the same without ROS's
launch, and ends with a summary and a report.
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
RESTART_DELAY = 1.0
"""[s]"""


def generate_launch_description() -> LaunchDescription:
    """The nodes, their parameter file, and where they keep what they know."""
    default_file = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "nodes.yaml"])
    arguments = [
        DeclareLaunchArgument(
            "folder", default_value=".", description="folder that stores and recordings are kept in, made if need be"
        ),
        DeclareLaunchArgument("throws", default_value="0", description="no more throws than these; 0: no end"),
        DeclareLaunchArgument("rate", default_value="1.0", description="simulated seconds per second; 0: as fast as possible"),
        DeclareLaunchArgument("arm", default_value="true", description="the simulated arm throws"),
        DeclareLaunchArgument("thrower", default_value="arm", description="who makes the throws: arm; none: one of your own"),
        DeclareLaunchArgument("auto", default_value="true", description="throw after throw, without being asked"),
        DeclareLaunchArgument("camera", default_value="poses", description="the simulated camera: poses, rendered, or none"),
        DeclareLaunchArgument(
            "topic", default_value="auto", description="the body's poses; auto: found by the name of the body"
        ),
        DeclareLaunchArgument("tag_map", default_value="", description="tags of body and board, for a rendering camera"),
        DeclareLaunchArgument("dashboard", default_value="false", description="serve the dashboard to a browser"),
        DeclareLaunchArgument("record", default_value="false", description="record all topics into session.mcap"),
        DeclareLaunchArgument(
            "params_file", default_value=default_file, description="parameters of the nodes that no argument sets"
        ),
        DeclareLaunchArgument("namespace", default_value="", description="namespace that holds all nodes and topics"),
        DeclareLaunchArgument("use_sim_time", default_value="false", description="time from the topic clock of the namespace"),
        DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn or error"),
    ]
    own = {
        "pose_ingest": {
            "topic": ParameterValue(LaunchConfiguration("topic"), value_type=str),
            "tag_map": ParameterValue(LaunchConfiguration("tag_map"), value_type=str),
        },
        "throw_designer": {
            "auto": ParameterValue(LaunchConfiguration("auto"), value_type=bool),
            "max_throws": ParameterValue(LaunchConfiguration("throws"), value_type=int),
            "thrower": ParameterValue(LaunchConfiguration("thrower"), value_type=str),
        },
    }
    stages = [_node(name, {"store": _in_folder(store), **own.get(name, {})}) for name, store in STORES.items()]
    return LaunchDescription([*arguments, OpaqueFunction(function=_make_folder), *stages, *_world(), *_listeners()])


def _world() -> list[Node]:
    """What stands for the robot and its tracker."""
    rate = ParameterValue(LaunchConfiguration("rate"), value_type=float)
    arm = {"rate": rate, "armed": True, "state": _in_folder("sim_arm.json")}
    camera = {
        "mode": ParameterValue(LaunchConfiguration("camera"), value_type=str),
        "tag_map": ParameterValue(LaunchConfiguration("tag_map"), value_type=str),
    }
    return [
        _node("sim_arm", arm, IfCondition(LaunchConfiguration("arm"))),
        _node("sim_camera", camera, IfCondition(NotEqualsSubstitution(LaunchConfiguration("camera"), "none"))),
    ]


def _listeners() -> list[Node]:
    return [
        _node("dashboard", {}, IfCondition(LaunchConfiguration("dashboard"))),
        _node("session_recorder", {"bag": _in_folder("session.mcap")}, IfCondition(LaunchConfiguration("record"))),
    ]


def _node(name: str, parameters: dict[str, object], condition: IfCondition | None = None) -> Node:
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
        parameters=[
            LaunchConfiguration("params_file"),
            {"use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)},
            parameters,
        ],
    )


def _in_folder(name: str) -> ParameterValue:
    return ParameterValue(PathJoinSubstitution([LaunchConfiguration("folder"), name]), value_type=str)


def _make_folder(context: LaunchContext) -> None:
    Path(LaunchConfiguration("folder").perform(context)).mkdir(parents=True, exist_ok=True)
