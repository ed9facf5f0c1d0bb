"""`simulate THROWS.json --out BAG.mcap`: simulates throws and writes them as the bag of a rig."""

import argparse
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from contact_curation.cli.options.body import add_body_option, chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.settings import add_settings, with_settings
from contact_curation.cli.options.types import natural_number
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.contact.body import Body
from contact_curation.design.execution_noise import DEFAULT_NOISE, ExecutionNoise
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.wording import counted
from contact_curation.simulation.thrown_toss import DEFAULT_THROWN, ThrownTossConfig, executed_throw, thrown_toss
from contact_curation.simulation.world import WorldConfig

STAGES = ("simulation", "noise")


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Simulates throws in MuJoCo and writes the poses that a tracker would have seen as the bag of a TagSLAM rig, for "
        "`rank` and the nodes to read. For a throw after which the body does not come to rest a line is printed to "
        "standard error; the others are written."
    )
    parser.add_argument("throws", type=Path, metavar="THROWS.json", help="throws that `contact-curation design` wrote")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="BAG.mcap", help="bag to write; without .mcap a rosbag2 folder"
    )
    add_overwrite_option(parser)
    add_body_option(parser)
    parser.add_argument(
        "--execution-noise",
        action="store_true",
        help="throws come out as in practice: off by 5 %% of the speed and 3 cm/s, 5 degrees, 0.4 rad/s, 5 mm (--set noise.*)",
    )
    parser.add_argument("--seed", type=natural_number, default=0, metavar="N", help="random seed of that noise (default 0)")
    add_settings(parser, STAGES)
    add_json_option(parser)
    parser.set_examples(
        "contact-curation simulate throws.json --out thrown.mcap",
        "contact-curation simulate throws.json --body brick.yaml --execution-noise --seed 1 --out thrown.mcap",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Simulates the throws, writes the bag, and prints a summary.

    Raises:
        UnreadableInputError: the file holds no throws, or none of them comes to rest.
        InvalidValueError: a throw is of another body, or `--out` cannot be written.
    """
    from contact_curation.motion.segmenter_config import SegmenterConfig
    from contact_curation.storage.bags.writer import BagWriter
    from contact_curation.storage.datasets.tagslam_bag import TagslamRig, made_up_time, record
    from contact_curation.storage.throws_file import read_throws

    check_outputs(overwrite=arguments.overwrite, out=arguments.out)
    thrower = _thrower(arguments)
    throws = read_throws(arguments.throws)
    for throw in throws:
        if throw.body != thrower.body.name:
            raise InvalidValueError(f"body of throw {throw.throw_id}", throw.body, f"{thrower.body.name}; see --body")
    rules = SegmenterConfig(frame_period=thrower.config.frame_period)
    rig = TagslamRig(rules=rules, epoch_ns=made_up_time(_digest(thrower.body, throws, arguments)))
    with Progress("throwing", "throws", len(throws)) as progress, BagWriter(arguments.out) as bag:
        count, frames = record(bag, thrower.body, thrower.tosses(throws, progress.advance), rig)
        if not count:
            raise UnreadableInputError(arguments.throws, f"found no throw that comes to rest: {thrower.left_out[0]}")
    warn([f"left out: {line}" for line in thrower.left_out])
    made = [throw.to_mapping() for throw in thrower.executed]
    if arguments.json:
        content = {"out": str(arguments.out), "tosses": count, "frames": frames}
        print_json({**content, "executed": made, "left_out": thrower.left_out})
    else:
        print(f"{arguments.out}: {count} of {counted(len(throws), 'throw')}, {frames} frames")
    return 0


def _digest(body: Body, throws: Sequence[Throw], arguments: argparse.Namespace) -> bytes:
    """Of all that the tosses of the bag follow from."""
    thrown = [body.to_mapping(), [throw.to_mapping() for throw in throws]]
    said = [*thrown, arguments.execution_noise, arguments.seed, arguments.settings]
    return hashlib.sha256(json.dumps(said, default=str).encode()).digest()


class _Thrower:
    """Simulates throws one after the other, and remembers the executed throws and those that were left out."""

    def __init__(self, body: Body, config: ThrownTossConfig, noise: ExecutionNoise | None, seed: int) -> None:
        self.body, self.config = body, config
        self.executed: list[Throw] = []
        self.left_out: list[str] = []
        self._noise = noise
        self._rng = np.random.default_rng(seed)

    def tosses(self, throws: Sequence[Throw], advance: Callable[[], None]) -> Iterator[Toss]:
        """The motions of the throws that come to rest."""
        for throw in throws:
            executed = executed_throw(throw, self._noise, self._rng) if self._noise else throw
            try:
                toss = thrown_toss(self.body, executed, self.config)
            except InvalidValueError as error:
                self.left_out.append(str(error))
            else:
                self.executed.append(executed)
                yield toss
            advance()


def _thrower(arguments: argparse.Namespace) -> _Thrower:
    body = chosen_body(arguments, throws=arguments.throws)
    usual = replace(DEFAULT_THROWN, world=WorldConfig.of_body(body))
    stages = with_settings({"simulation": usual, "noise": DEFAULT_NOISE}, arguments.settings)
    if not arguments.execution_noise and stages["noise"] != DEFAULT_NOISE:
        raise InvalidValueError("--set noise.*", "no --execution-noise", "--execution-noise, which it belongs to")
    noise = ExecutionNoise.expected(stages["noise"]) if arguments.execution_noise else None
    return _Thrower(body, stages["simulation"], noise, arguments.seed)
