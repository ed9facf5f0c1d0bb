"""`evaluate CHECKPOINT INPUT...`: how far a model's motions are from measured ones, and how surely its parameters are known."""

import argparse
from pathlib import Path

from contact_curation.cli.options.held_out import add_held_out_option
from contact_curation.cli.options.reading import SHARED_STAGES, add_reading_options
from contact_curation.cli.options.types import PathEndingIn, natural_number
from contact_curation.cli.report import add_json_option

STAGES = (*SHARED_STAGES, "loss", "sweeps", "bootstrap", "known")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Rolls the model out from the first measured state of each toss that it did not learn from, and says how far it is "
        "from what was measured. Of a polytope it also says how surely every parameter is known from the other tosses."
    )
    parser.add_argument(
        "model", type=Path, metavar="CHECKPOINT", help="a .safetensors file from `train`, or a polytope as a JSON file"
    )
    add_reading_options(parser, STAGES)
    parser.add_argument("--against", type=Path, metavar="CHECKPOINT", help="another model, compared with on the same tosses")
    group = parser.add_argument_group("which tosses it is judged by")
    add_held_out_option(group, "default: those that the checkpoint held out; all where it says of none")
    group.add_argument("--no-gate", action="store_true", help="take what the gates would keep back, too")
    output = parser.add_argument_group("output")
    output.add_argument("--figure", type=PathEndingIn(".png"), metavar="FILE.png", help="predicted against measured motion")
    output.add_argument("--seed", type=natural_number, metavar="N", help="of the bootstrap (default 0)")
    add_json_option(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads, rolls out, and says what came of it.

    Raises:
        ContactCurationError: a model or the tosses cannot be used, or the figure cannot be written.
    """
    from contact_curation.cli.evaluate.run import run_evaluation  # torch takes over a second, which --help need not wait for

    return run_evaluation(arguments)
