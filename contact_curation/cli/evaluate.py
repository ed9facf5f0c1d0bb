"""`evaluate CHECKPOINT INPUT...`: prediction errors of a model, and the uncertainty of its parameters."""

import argparse
from dataclasses import replace
from pathlib import Path

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.reading import (
    SHARED_STAGES,
    add_held_out_option,
    add_reading_options,
    inputs_of,
    stages_of,
)
from contact_curation.cli.options.settings import add_fields, with_options
from contact_curation.cli.options.types import PathEndingIn, positive_integer
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.time_step import DEFAULT_LIMITS
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import read_tosses
from contact_curation.solver.compiled import load_kernel

STAGES = (*SHARED_STAGES, "loss", "sweeps", "bootstrap", "known")


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Rolls the model out from the first measured state of each toss that it was not trained on, and reports the "
        "errors of the predicted motion. For a polytope it also reports the uncertainty of each parameter, estimated from "
        "the other tosses."
    )
    parser.add_argument(
        "model", type=Path, metavar="CHECKPOINT", help="a .safetensors file from `train`, or a polytope as a JSON file"
    )
    add_reading_options(parser, STAGES)
    parser.add_argument("--against", type=Path, metavar="CHECKPOINT", help="another model to compare with on the same tosses")
    group = parser.add_argument_group("which tosses it is evaluated on")
    add_held_out_option(group, "default: those that the checkpoint held out, or all if there are none")
    group.add_argument("--no-gate", action="store_true", help="evaluate on tosses that the quality checks would reject, too")
    parser.add_argument(
        "--more",
        type=positive_integer,
        metavar="K",
        help="say how far K more throws like those that it learned from would change predictions (default: as many again)",
    )
    output = parser.add_argument_group("output")
    output.add_argument(
        "--figure", type=PathEndingIn(".png"), metavar="FILE.png", help="figure of predicted and measured motions"
    )
    add_overwrite_option(output)
    add_fields(output, BootstrapConfig(), "seed", told={"seed": "of the bootstrap"})
    add_json_option(parser)
    parser.set_examples(
        "contact-curation evaluate model.safetensors test.mcap --figure motion.png",
        "contact-curation evaluate model.safetensors test.mcap --against random.safetensors",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads the tosses, predicts their motions, and prints the errors.

    Raises:
        ContactCurationError: a model or the tosses cannot be used, or the figure cannot be written.
    """
    from contact_curation.learning.uncertainty.parameters import KnownConfig  # importing torch takes over a second
    from contact_curation.pipeline.evaluation import evaluate_models, evaluation_config, judging_tosses
    from contact_curation.pipeline.learned_model import load_model

    load_kernel()  # rollouts need it; an error should come before tosses are read
    check_outputs(overwrite=arguments.overwrite, figure=arguments.figure)
    body = chosen_body(arguments, models=[arguments.model, arguments.against])
    defaults = {"loss": DEFAULT_LOSS, "sweeps": DEFAULT_LIMITS, "bootstrap": BootstrapConfig(), "known": KnownConfig()}
    stages = stages_of(arguments, defaults)
    reading = ReadingConfig(body, inputs_of(stages, gated=not arguments.no_gate))
    bootstrap = with_options(stages["bootstrap"], arguments, "seed")
    config = evaluation_config(loss=stages["loss"], sweeps=stages["sweeps"], bootstrap=bootstrap)
    models = [load_model(path, body) for path in (arguments.model, arguments.against) if path]
    with Progress("reading", "tosses") as bar:
        read = read_tosses(arguments.inputs, reading, advance=bar.advance)
    tosses = judging_tosses(read, arguments.held_out, models, loss=config.loss)
    warn(tosses.warnings)
    found = evaluate_models(models, tosses, config, replace(stages["known"], loss=stages["loss"]), Progress, arguments.more)
    if arguments.figure:
        found.save_figure(arguments.figure, overwrite=True)  # was checked before the work
    if arguments.json:
        print_json({**found.document(), "figure": str(arguments.figure) if arguments.figure else None})
    else:
        print("\n".join(found.lines()))
        if arguments.figure:
            print(f"figure: {arguments.figure}")
    return 0
