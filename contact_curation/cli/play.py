"""`play BAG`: plays a bag as live topics. The process becomes the player node, so that signals reach the node."""

import argparse
import json
import os
import re
import sys
from pathlib import Path
from typing import Any, Never

from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.types import number_from_zero, positive_number
from contact_curation.errors import InvalidValueError
from contact_curation.session.graph import node_program, within_this_machine

ROS_NAME = re.compile(r"~?/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Publishes a bag's messages at the times they were recorded. The node's services pause, resume and seek. "
        "Only this machine hears it, unless ROS_AUTOMATIC_DISCOVERY_RANGE (e.g. SUBNET) says how far it is heard."
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="an MCAP file, a rosbag2 folder or a ROS 1 bag")
    parser.add_argument(
        "--rate", type=positive_number, default=1.0, metavar="R", help="recorded seconds per second (default 1)"
    )
    parser.add_argument("--loop", action="store_true", help="begin again at the end")
    parser.add_argument("--start-offset", type=number_from_zero, default=0.0, metavar="S", help="seconds to skip at the start")
    parser.add_argument("--clock", type=positive_number, default=0.0, metavar="HZ", help="publish /clock at this rate")
    parser.add_argument(
        "--topics",
        nargs="+",
        action="extend",
        default=[],
        metavar="TOPIC",
        help="only these topics (default: all but results of the nodes)",
    )
    parser.add_argument(
        "--remap", nargs="+", action="extend", default=[], type=_remapping, metavar="OLD:=NEW", help="rename topics"
    )
    parser.add_argument("--start-paused", action="store_true", help="wait for the resume service")
    parser.add_argument("--as-fast-as-possible", action="store_true", help="do not wait between messages")
    parser.set_examples(
        "contact-curation play session.mcap --rate 2",
        "contact-curation play session.mcap --topics /tf /tf_static --remap /tf:=/cell_1/tf --loop",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> Never:
    """Replaces this process by the player node.

    Raises:
        InvalidValueError: the path is not valid UTF-8 and cannot be passed to a node.
    """
    try:
        str(arguments.bag).encode()
    except UnicodeEncodeError as error:
        raise InvalidValueError("path of the bag", ascii(str(arguments.bag)), "one in UTF-8, as ROS wants it") from error
    command = player_command(arguments)
    sys.stdout.flush()
    sys.stderr.flush()
    os.execve(command[0], command, within_this_machine(os.environ))


def player_command(arguments: argparse.Namespace) -> list[str]:
    """The command of the player node; options become ROS parameters of the same names, renamed topics ROS remappings."""
    parameters: dict[str, Any] = {
        "bag": str(arguments.bag),
        "rate": arguments.rate,
        "loop": arguments.loop,
        "start_offset": arguments.start_offset,
        "clock": arguments.clock,
        "start_paused": arguments.start_paused,
        "as_fast_as_possible": arguments.as_fast_as_possible,
    }
    if arguments.topics:  # ROS cannot infer the type of an empty list
        parameters["topics"] = arguments.topics
    command = [*node_program("player"), "--ros-args"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={json.dumps(value)}"]  # JSON is YAML: words stay words
    for remapping in arguments.remap:
        command += ["-r", remapping]
    return command


def _remapping(text: str) -> str:
    old, _, new = text.partition(":=")
    if not (ROS_NAME.fullmatch(old) and ROS_NAME.fullmatch(new)):
        raise argparse.ArgumentTypeError(f"found {text}, expected OLD:=NEW, both names of ROS")
    return text
