"""What each node of a session is told: by the parameter file, over that by options, over that by the session itself."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from contact_curation.cli.online.options import OnlineConfig
from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.files import write_atomically
from contact_curation.geometry.tag_rig import rig_of
from contact_curation.session.free_port import free_port
from contact_curation.session.parameter_files import EVERY_NODE, Parameters, read_node_parameters
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.tag_map_file import tag_rig_yaml

STAGES = ("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "sim_camera")
"""The nodes of the loop, in the order they are started."""

DASHBOARD, RECORDER = "dashboard", "session_recorder"
OTHERS = ("player",)
"""Nodes that a file may have parameters of, and a session does not start."""

DEFAULTS = Path(__file__).resolve().parents[1] / "config" / "nodes.yaml"
"""Every parameter of every node."""

OF_ROS = ("use_sim_time", "qos_overrides.", "start_type_description_service")
"""Beginnings of parameters that every node has."""

OF_BODIES = ("pose_ingest", "fisher_scorer", "trainer", "throw_designer", "sim_arm", "sim_camera", DASHBOARD)
SEEDED = ("curator", "trainer", "sim_arm", "sim_camera")
BOARD_FRAME = "body_surface"
PORTS = {"web_port": 9090, "grpc_port": 9876}
"""Of the dashboard, where they are free."""

TIMEOUTS = {"toss_timeout": (3.0, 12.0), "goal_timeout": (15.0, 45.0)}
"""How long the designer waits, for a throw's toss and for a throw to be made: so many seconds, and so many simulated ones."""

UNTOLD = InputsConfig()
"""How recordings are read of which nothing is said."""

KINDS = {bool: "true or false", int: "a whole number", float: "a number with a point", str: "a word", list: "a list"}
"""What parameters are, in words."""

RENDERING = 600.0
"""[s] that a throw's images may take to be rendered, on a machine without a GPU."""


class SessionFolder:
    """Where the things of a session lie.

    Args:
        root: the folder; made when there is none.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.bag = root / "session.mcap"
        self.recording = root / "session.rrd"
        self.checkpoint = root / "checkpoint.safetensors"
        self.manifest = root / "manifest.parquet"
        self.events = root / "events.jsonl"
        self.summary = root / "session.json"
        self.report = root / "report.html"
        self.parameters = root / "parameters.yaml"
        self.tag_map = root / "tag_map.yaml"
        self.logs = root / "logs"
        self.stores = root / "stores"
        self.figures = root / "figures"

    def store(self, node: str) -> Path:
        """The store of a node."""
        return self.stores / f"{node}.sqlite"

    def make(self) -> None:
        """Makes the folders.

        Raises:
            InvalidValueError: there is a session already, or they cannot be made.
        """
        if self.events.exists() or self.bag.exists():
            raise InvalidValueError("--record", self.root, "a folder without a session in it")
        try:
            for folder in (self.logs, self.stores, self.figures):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidValueError("--record", self.root, f"a folder that can be made ({error.strerror})") from error


def session_parameters(config: OnlineConfig, body: Body, folder: SessionFolder) -> dict[str, Parameters]:
    """Parameters by node, of the nodes that are to run.

    Raises:
        ContactCurationError: the parameter file is none, or is for nodes that there are not.
    """
    names = [*STAGES, *([DASHBOARD] if config.dashboard or config.record else []), *([RECORDER] if config.record else [])]
    given = _given(config)
    optional = _of_options(config, body)
    merged: dict[str, Parameters] = {}
    for name in names:
        merged[name] = {**given.get(EVERY_NODE, {}), **given.get(name, {}), **optional.get(name, {})}
    arm = {name: value for name, value in merged["sim_arm"].items() if name.startswith("arm.")}
    rate = float(merged["sim_arm"].get("rate", 1.0))
    timeouts = {name: real + (simulated / rate if rate else 0.0) for name, (real, simulated) in TIMEOUTS.items()}
    timeouts["toss_timeout"] += RENDERING if config.camera == "rendered" else 0.0
    merged["throw_designer"] = {**timeouts, **merged["throw_designer"], **arm}
    if config.dashboard:
        merged[DASHBOARD] = {**{name: free_port(port) for name, port in PORTS.items()}, **merged[DASHBOARD]}
    for name, values in _of_session(config, body, folder).items():
        if name in merged:
            merged[name] |= values
    return merged


def judged_inputs(config: OnlineConfig) -> InputsConfig:
    """How the trainer reads the recordings that its model is judged by.

    Raises:
        ContactCurationError: the parameter file is none, or says what cannot be.
    """
    given = _given(config)
    told = {**given.get(EVERY_NODE, {}), **given.get("trainer", {})}
    noise = float(told.get("segmenter.tracker_noise", UNTOLD.segmenter.tracker_noise))
    own = {name.removeprefix("rig."): value for name, value in told.items() if name.startswith("rig.")}
    rig: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in own.items()}
    return replace(UNTOLD, segmenter=replace(UNTOLD.segmenter, tracker_noise=noise), rig=replace(UNTOLD.rig, **rig))


def _given(config: OnlineConfig) -> dict[str, Parameters]:
    """By node, what the parameter file says."""
    given = read_node_parameters(config.params_file) if config.params_file else {}
    _check_names(given, config.params_file)
    return given


def write_tag_map(config: OnlineConfig, body: Body, folder: SessionFolder) -> None:
    """The tags that a rendering camera sees, for whoever reads its detections."""
    if config.camera == "rendered":
        rig = rig_of(body.polytope, f"body_{body.name}", BOARD_FRAME)
        write_atomically(folder.tag_map, tag_rig_yaml(rig).encode())


def _check_names(given: Mapping[str, Parameters], path: Path | None) -> None:
    """ROS takes no notice of a parameter that a node does not have, so that a slip of the pen would change nothing."""
    known = (EVERY_NODE, *STAGES, DASHBOARD, RECORDER, *OTHERS)
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise InvalidValueError(f"nodes in {path}", ", ".join(unknown), f"some of {', '.join(known)}")
    declared = read_node_parameters(DEFAULTS) if given else {}
    declared[EVERY_NODE] = {name: value for values in declared.values() for name, value in values.items()}
    for node, values in given.items():
        unknown = [name for name in values if name not in declared[node] and not name.startswith(OF_ROS)]
        if unknown:
            raise InvalidValueError(f"parameters of {node} in {path}", ", ".join(unknown), "those of config/nodes.yaml")
        for name, value in values.items():
            default = declared[node].get(name)
            if default is not None and not _is_like(value, default):
                raise InvalidValueError(f"{name} of {node} in {path}", value, f"{KINDS[type(default)]}, such as {default}")


def _is_like(value: object, default: object) -> bool:
    """Whether ROS gives a parameter with this default this value: it takes 1 for no 1.0."""
    if isinstance(value, list) and isinstance(default, list):
        return all(_is_like(each, default[0]) for each in value)
    return type(value) is type(default) and value == value  # and not .nan


def _of_options(config: OnlineConfig, body: Body) -> dict[str, Parameters]:
    """What was asked for on the command line."""
    optional: dict[str, Parameters] = {name: {} for name in (*STAGES, DASHBOARD)}
    if config.body_file is not None:
        for name in OF_BODIES:
            optional[name]["body_file"] = str(config.body_file.absolute())
        optional["curator"]["body"] = body.name
    if config.seed is not None:
        for name in SEEDED:
            optional[name]["seed"] = config.seed
    for name, value in (("top", config.top), ("criterion", config.criterion)):
        if value is not None:
            optional["curator"][name] = value
    if config.held_out:
        optional["trainer"]["held_out"] = [str(path.absolute()) for path in config.held_out]
    if config.rate is not None:
        optional["sim_arm"]["rate"] = config.rate
    return optional


def _of_session(config: OnlineConfig, body: Body, folder: SessionFolder) -> dict[str, Parameters]:
    """What makes the nodes one session.

    The topic of the poses is named: where pose_ingest looks before the camera is there, the ground truth is the only one.
    """
    own: dict[str, Parameters] = {name: {"store": str(folder.store(name).absolute())} for name in STAGES[:5]}
    own["trainer"] |= {"checkpoint": str(folder.checkpoint.absolute())}
    own["throw_designer"] |= {"auto": True, "max_throws": config.throws, "thrower": "arm"}
    own["sim_arm"] = {"armed": True, "external_heartbeat": False, "state": str((folder.stores / "sim_arm.json").absolute())}
    own["sim_camera"] = {"mode": config.camera}
    if config.camera == "rendered":
        own["pose_ingest"] |= {"tag_map": str(folder.tag_map.absolute()), "topic": ""}
    else:
        own["pose_ingest"] |= {"tag_map": "", "topic": f"/tagslam/odom/body_{body.name}"}
    own[RECORDER] = {"bag": str(folder.bag.absolute())}
    own[DASHBOARD] = {"recording": str(folder.recording.absolute()) if config.record else ""}
    if not config.dashboard:
        own[DASHBOARD] |= {"web_port": 0}
    return own
