"""`design --out THROWS.json`: the throws with the largest predicted information, given theta and the known tosses."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from contact_curation.cli.options.body import add_body_option, chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.reading import (
    POSES,
    SHARED_STAGES,
    Recordings,
    add_params_option,
    add_pose_options,
    inputs_of,
    stages_of,
)
from contact_curation.cli.options.settings import add_settings
from contact_curation.cli.options.types import PathEndingIn, natural_number, positive_integer
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.design.candidates import CandidateConfig
from contact_curation.design.planner import DesignConfig
from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.design import BASELINES, EXPLORATION, METHODS, DesignTask, design_throws
from contact_curation.pipeline.division import ranked_otherwise
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.theta import described_polytope, of_other_rigs, polytope_of
from contact_curation.pipeline.tosses import Tosses, copies_among, read_tosses
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.export.selected import check_all_found, ranked_recordings, selected_rows
from contact_curation.storage.manifest.file import read_manifest
from contact_curation.storage.manifest.manifest import Manifest

CANDIDATES = ("forecast", "safety", "noise", "placement")
STAGES = ("design", *CANDIDATES, "refinement", "loss", *SHARED_STAGES)


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Designs a batch of throws: picks them greedily from a pool of safe releases by their predicted gain in log-det "
        "under execution noise, and then refines them. Theta must be a polytope's."
    )
    add_params_option(
        parser.add_argument_group("what is to be learned"),
        "theta: a polytope's checkpoint or JSON file; given several times, gains are averaged over them (default: the object "
        "as described)",
    )
    add_body_option(parser)
    group = parser.add_argument_group("what is known")
    group.add_argument(
        "--known",
        nargs="+",
        action=Recordings,
        default=[],
        metavar="INPUT",
        help="recordings of tosses that are known (default none)",
    )
    group.add_argument(
        "--manifest", type=Path, metavar="FILE", help="manifest: of those recordings, use only the tosses that it selected"
    )
    group.add_argument(
        "--prior",
        nargs="+",
        action=Recordings,
        default=[],
        metavar="INPUT",
        help="recordings of throws like those to be made (default: the published statistics of ContactNets' releases)",
    )
    add_pose_options(parser)
    group = parser.add_argument_group("throws")
    group.add_argument("--throws", type=positive_integer, default=8, metavar="N", help="number of throws (default 8)")
    group.add_argument(
        "--seed",
        type=natural_number,
        default=0,
        metavar="N",
        help="random seed; the same seed gives the same throws (default 0)",
    )
    group.add_argument("--name", default="throw", help="beginning of the throws' ids (default throw)")
    ways = group.add_mutually_exclusive_group()
    ways.add_argument(
        "--baseline",
        choices=BASELINES,
        help="for comparison; paper: the best by trace from a normal in raw coordinates; prior: at random from the prior",
    )
    ways.add_argument(
        "--exploration-throws",
        action="store_true",
        help="choose different first impacts instead of information, when nothing is learned yet",
    )
    group.add_argument("--arm", action="store_true", help="only throws that the simulated arm can make")
    add_settings(parser, STAGES)
    group = parser.add_argument_group("output")
    group.add_argument("--out", type=PathEndingIn(".json"), required=True, metavar="THROWS.json", help="file for the throws")
    add_overwrite_option(group)
    add_json_option(parser)
    parser.set_examples(
        "contact-curation design --params model.safetensors --known session.mcap --throws 8 --out throws.json",
        "contact-curation design --body brick.yaml --exploration-throws --throws 4 --out first_throws.json",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Designs the throws, writes them, and prints their predicted gains.

    Raises:
        ContactCurationError: a file cannot be used, nothing safe can be thrown, or `--out` cannot be written.
    """
    load_kernel()  # rollouts, by which information is predicted, need it
    check_outputs(overwrite=arguments.overwrite, out=arguments.out)
    task, reading = design_task(arguments)
    known, seen = _known(arguments, reading)
    prior = _read(arguments.prior, reading) if arguments.prior else None
    examples, warnings = (prior.in_order_of_ids, prior.warnings) if prior else ((), ())
    warnings = (*(of_other_rigs(arguments.params, reading.inputs.rig) if known else ()), *seen, *warnings)
    warn(warnings)
    task = replace(task, known=known, examples=examples)
    with Progress("designing", "simulated throws", task.simulations(arguments.throws)) as progress:
        throws = design_throws(task, arguments.throws, progress.advance)
    throws.save(arguments.out, overwrite=True)  # was checked before the work
    if arguments.json:
        print_json({"out": str(arguments.out), **throws.document(), "warnings": warnings})
    else:
        print("\n".join(throws.table()))
        print(f"{arguments.out}: {throws.summary()}")
    return 0


def design_task(arguments: argparse.Namespace) -> tuple[DesignTask, ReadingConfig]:
    """The task that the options describe, before tosses are read, and the configuration of reading.

    Raises:
        ContactCurationError: a file cannot be used, or a setting is not accepted.
    """
    _check_recordings(arguments)
    candidates, design = CandidateConfig(), DesignConfig()
    judged = {name: getattr(candidates, name) for name in CANDIDATES}
    stages = stages_of(arguments, {"design": design, **judged, "refinement": design.refinement, "loss": DEFAULT_LOSS})
    candidates = replace(candidates, **{name: stages[name] for name in CANDIDATES})
    body = chosen_body(arguments, models=arguments.params, manifest=arguments.manifest)
    thetas = tuple(polytope_of(path, body) for path in arguments.params)
    task = DesignTask(
        thetas=thetas or (described_polytope(body),),
        config=replace(stages["design"], candidates=candidates, refinement=stages["refinement"]),
        loss=stages["loss"],
        method=EXPLORATION if arguments.exploration_throws else arguments.baseline or METHODS[0],
        arm=arguments.arm,
        seed=arguments.seed,
        name=arguments.name,
    )
    return task, ReadingConfig(body, inputs_of(stages))


def _check_recordings(arguments: argparse.Namespace) -> None:
    """Refuses options on recordings where none is read.

    Raises:
        InvalidValueError: such an option is given, and no recording.
    """
    if arguments.known or arguments.prior:
        return
    given = [f"--{name.replace('_', '-')}" for name in POSES if getattr(arguments, name) is not None]
    given += [f"--set {one}" for one in arguments.settings if one.partition(".")[0] in SHARED_STAGES]
    if given:
        raise InvalidValueError(given[0], "no --known and no --prior", "recordings, which it is about")


def _known(arguments: argparse.Namespace, reading: ReadingConfig) -> tuple[tuple[Toss, ...], tuple[str, ...]]:
    """The known tosses in the order of their ids, and warnings.

    Raises:
        ContactCurationError: a manifest is given without recordings, its selected tosses are not in them, or there is no toss.
    """
    if not arguments.known and arguments.manifest is not None:
        raise InvalidValueError(
            "--manifest", f"{arguments.manifest} and no --known", "--known INPUT..., the recordings that it is of"
        )
    if not arguments.known:
        return (), ()
    manifest = read_manifest(arguments.manifest) if arguments.manifest else None
    tosses = _read(arguments.known, reading, manifest)
    warnings = tosses.warnings
    if manifest is not None:
        selected = selected_rows(manifest, arguments.manifest)
        check_all_found(selected, tosses.by_id, arguments.manifest, warnings)
        tosses, warnings = tosses.only(selected), (*warnings, *ranked_otherwise(manifest, arguments.manifest, tosses))
    return tosses.in_order_of_ids, (*warnings, *copies_among(tosses, tosses.body))


def _read(paths: Sequence[Path], reading: ReadingConfig, manifest: Manifest | None = None) -> Tosses:
    """The tosses of recordings; those that a manifest names from the recordings that it was made from."""
    meant = ranked_recordings(manifest.rows) if manifest else {}
    with Progress("reading", "tosses") as progress:
        return read_tosses(paths, reading, advance=progress.advance, meant=meant).check_some("no toss")
