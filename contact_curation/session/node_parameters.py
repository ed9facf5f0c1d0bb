"""What each node of a session is told: by the parameter file, over that by options, over that by the session itself.

`config/nodes.yaml` has every parameter of every node with its default, made of what the nodes declare.
"""

import socket
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.files import write_atomically
from contact_curation.geometry.tag_rig import rig_of
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.parameter_files import EVERY_NODE, Parameters, read_node_parameters
from contact_curation.stages.held_out_tosses import HeldOutConfig
from contact_curation.stages.parameters import with_parameters
from contact_curation.stages.throw_loop import LoopConfig
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.tag_map_file import tag_rig_yaml

STAGES = ("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "sim_camera")
"""The nodes of the loop, in the order they are started."""

STORING = STAGES[:5]
DASHBOARD, RECORDER = "dashboard", "session_recorder"

DEFAULTS = Path(__file__).resolve().parents[1] / "config" / "nodes.yaml"

OF_ROS = ("use_sim_time", "qos_overrides.", "start_type_description_service")
"""Beginnings of parameters that every node has."""

READINESS = ("enabled", "least_tosses", "recent", "largest_loss", "least_agreement", "most_tosses")
FORMER_NAMES = {
    "body_file": "body",
    "held_out": "evaluate_on",
    "recording": "rrd",
    "warm_up": "prior_tosses",
    **{f"canary.{name}": f"readiness.{name}" for name in READINESS},
}
"""Of parameters, with their present ones; they are still taken."""

PLACES = frozenset(
    ["store", "checkpoint", "state", "bag", "rrd", "body", "tag_map", "topic", "web_port", "grpc_port", "max_throws", "throws"]
)
"""Parameters that may change when a session goes on: where things lie, and how many throws it is to have."""

OF_RANKING = ("prior", "cut")
"""Parameters of the curator that the dashboard has to know."""

KINDS = {bool: "true or false", int: "a whole number", float: "a number with a point", str: "a word", list: "a list"}
"""What parameters are, in words."""

RENDERING = 600.0
"""[s] that a throw's images may take to be rendered, on a machine without a GPU."""


@cache
def declared_parameters() -> Mapping[str, Parameters]:
    """Every parameter of every node, with its default."""
    return read_node_parameters(DEFAULTS)


def session_parameters(config: SessionConfig, body: Body, folder: SessionFolder) -> dict[str, Parameters]:
    """Parameters by node, of the nodes that are to run.

    Raises:
        ContactCurationError: the parameter file is none, or is for nodes that there are not.
    """
    names = [*STAGES, *([DASHBOARD] if config.dashboard or config.record else []), *([RECORDER] if config.record else [])]
    given, optional, own = _given(config), _of_options(config), _of_session(config, body, folder)
    merged: dict[str, Parameters] = {}
    for name in names:
        merged[name] = {**given.get(EVERY_NODE, {}), **given.get(name, {}), **optional.get(name, {})}
    merged["throw_designer"] = {**_of_the_arm(config, merged["sim_arm"]), **merged["throw_designer"]}
    if DASHBOARD in merged:
        of_ranking = {name: value for name, value in merged["curator"].items() if name in OF_RANKING}
        merged[DASHBOARD] = {**(_free_ports() if config.dashboard else {}), **of_ranking, **merged[DASHBOARD]}
    return {name: values | own.get(name, {}) for name, values in merged.items()}


def check_camera(before: Mapping[str, Parameters], config: SessionConfig) -> None:
    """Refuses to go on with another camera: of poses and detections in one bag only either are read.

    Raises:
        InvalidValueError: the session has another one.
    """
    was = before.get("sim_camera", {}).get("mode", config.camera)
    if was != config.camera:
        raise InvalidValueError("--camera", config.camera, f"{was}, which the session has, or a new folder for --record")


def changed_parameters(before: Mapping[str, Parameters], now: Mapping[str, Parameters]) -> str:
    """What nodes are told otherwise than before, in words; empty where nothing is."""
    changes = []
    for node in sorted(set(before) & set(now)):
        for name in sorted({*before[node], *now[node]} - PLACES):
            was, is_now = (_value(each, node, name) for each in (before, now))
            changes += [f"{node} {name} {was!r} before, now {is_now!r}"] if was != is_now else []
    return "; ".join(changes)


def held_out_inputs(config: SessionConfig) -> InputsConfig:
    """How the trainer reads the recordings that its model is evaluated on.

    Raises:
        ContactCurationError: the parameter file is none, or says what cannot be.
    """
    given = _given(config)
    return with_parameters(HeldOutConfig(), {**given.get(EVERY_NODE, {}), **given.get("trainer", {})}).inputs


def write_tag_map(config: SessionConfig, body: Body, folder: SessionFolder, parameters: Mapping[str, Parameters]) -> None:
    """The tags that a rendering camera sees, for whoever reads its detections."""
    if config.rendered:
        rig = rig_of(body.tracked_polytope, f"body_{body.name}", _value(parameters, "sim_camera", "board_frame"))
        write_atomically(folder.tag_map, tag_rig_yaml(rig).encode())


def free_port(wanted: int) -> int:
    """The port that is wanted, or another one where that is taken; somebody else may still be faster."""
    for port in (wanted, 0):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    return wanted


def _value(parameters: Mapping[str, Parameters], node: str, name: str) -> Any:
    """What a node is told, or its default."""
    return parameters[node].get(name, declared_parameters()[node].get(name))


def _given(config: SessionConfig) -> dict[str, Parameters]:
    """By node, what the parameter file says."""
    given = read_node_parameters(config.params_file) if config.params_file else {}
    given = {node: _with_present_names(node, values) for node, values in given.items()}
    _check_names(given, config.params_file)
    return given


def _with_present_names(node: str, values: Parameters) -> Parameters:
    declared = declared_parameters()
    own = {name for each in declared.values() for name in each} if node == EVERY_NODE else set(declared.get(node, {}))
    now = {former: present for former, present in FORMER_NAMES.items() if present in own}
    return {now.get(name, name): value for name, value in values.items()}


def _check_names(given: Mapping[str, Parameters], path: Path | None) -> None:
    """ROS takes no notice of a parameter that a node does not have, so that a slip of the pen would change nothing."""
    if not given:
        return
    declared: dict[str, Parameters] = {EVERY_NODE: {}, **declared_parameters()}
    unknown = sorted(set(given) - set(declared))
    if unknown:
        raise UnknownNameError(f"node in {path}:", unknown[0], declared)
    for values in declared_parameters().values():
        declared[EVERY_NODE] |= values
    for node, values in given.items():
        unknown = [name for name in values if name not in declared[node] and not name.startswith(OF_ROS)]
        if unknown:
            raise UnknownNameError(f"parameter of {node} in {path}:", unknown[0], declared[node])
        for name, value in values.items():
            default = declared[node].get(name)
            if default is not None and not _is_like(value, default):
                raise InvalidValueError(f"{name} of {node} in {path}", value, f"{KINDS[type(default)]}, such as {default}")


def _is_like(value: object, default: object) -> bool:
    """Whether ROS gives a parameter with this default this value: it takes 1 for no 1.0."""
    if isinstance(value, list) and isinstance(default, list):
        return all(_is_like(each, default[0]) for each in value)
    return type(value) is type(default) and value == value  # and not .nan


def _of_options(config: SessionConfig) -> dict[str, Parameters]:
    """What was asked for on the command line; what many nodes have is told to all of them that do."""
    shared: Parameters = {} if config.seed is None else {"seed": config.seed}
    if config.body_file is not None:
        shared["body"] = str(config.body_file.absolute())
    optional = {
        node: {name: value for name, value in shared.items() if name in declared}
        for node, declared in declared_parameters().items()
    }
    curator = {"top": config.top, "criterion": config.criterion}
    optional["curator"] |= {name: value for name, value in curator.items() if value is not None}
    if config.evaluate_on:
        optional["trainer"]["evaluate_on"] = [str(path.absolute()) for path in config.evaluate_on]
    if config.rate is not None:
        optional["sim_arm"]["rate"] = config.rate
    return optional


def _of_the_arm(config: SessionConfig, arm: Parameters) -> Parameters:
    """What the designer has to know of the simulated arm: its place, and how long it takes."""
    loop = LoopConfig().at_rate(float(_value({"sim_arm": arm}, "sim_arm", "rate")))
    known = {name: value for name, value in arm.items() if name.startswith("arm.")}
    rendering = RENDERING if config.rendered else 0.0
    return {"toss_timeout": loop.toss_timeout + rendering, "goal_timeout": loop.goal_timeout, **known}


def _free_ports() -> Parameters:
    """The dashboard's own where they are free."""
    return {name: free_port(declared_parameters()[DASHBOARD][name]) for name in ("web_port", "grpc_port")}


def _of_session(config: SessionConfig, body: Body, folder: SessionFolder) -> dict[str, Parameters]:
    """What makes the nodes one session.

    The topic of the poses is named: where pose_ingest looks before the camera is there, the ground truth is the only one.
    """
    own: dict[str, Parameters] = {name: {"store": str(folder.store(name).absolute())} for name in STORING}
    own["trainer"] |= {"checkpoint": str(folder.checkpoint.absolute())}
    own["throw_designer"] |= {"auto": True, "max_throws": config.throws or 0, "thrower": "arm"}
    own["sim_arm"] = {"armed": True, "external_heartbeat": False, "state": str((folder.stores / "sim_arm.json").absolute())}
    own["sim_camera"] = {"mode": config.camera}
    if config.rendered:
        own["pose_ingest"] |= {"tag_map": str(folder.tag_map.absolute()), "topic": ""}
    else:
        own["pose_ingest"] |= {"tag_map": "", "topic": f"/tagslam/odom/body_{body.name}"}
    own[RECORDER] = {"bag": str(folder.bag.absolute())}
    own[DASHBOARD] = {"throws": config.throws or 0, "rrd": str(folder.recording.absolute()) if config.record else ""}
    own[DASHBOARD] |= {"state": str(folder.dashboard.absolute())} if config.dashboard else {"web_port": 0}
    return own
