"""The options of `train`; what they ask for is in `train_config`, which takes longer to import."""

import argparse
from pathlib import Path

from contact_curation.cli.options.held_out import add_held_out_option
from contact_curation.cli.options.reading import SHARED_STAGES, add_reading_options
from contact_curation.cli.options.types import PathEndingIn, natural_number, number_from_zero, positive_integer
from contact_curation.cli.report import add_json_option
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.registry import DEFAULT_MODEL, MODELS
from contact_curation.information.criteria.orthogonal import VARIANTS
from contact_curation.information.ranker import DEFAULT_CRITERION, criterion_names

STAGES = (*SHARED_STAGES, "training", "ranking", "canary")
PROTOCOLS = ("budgeted", "published", "exact")
DEFAULT_SHARE = 0.2
"""Of the tosses that is held out where nothing else is said."""

CHECKPOINT_SECONDS = 30.0


def add_train_options(parser: argparse.ArgumentParser) -> None:
    """Adds all options."""
    add_reading_options(parser, STAGES)
    _add_model_options(parser)
    _add_toss_options(parser)
    _add_output_options(parser)


def _add_model_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what is trained, and how")
    group.add_argument(
        "--model",
        choices=list(MODELS),
        default=DEFAULT_MODEL,
        help="the model (default polytope)",
    )
    group.add_argument(
        "--params",
        type=Path,
        metavar="FILE",
        help="where to start: a checkpoint, or a polytope as JSON (default: the published random initialisation)",
    )
    group.add_argument(
        "--protocol",
        choices=PROTOCOLS,
        default=PROTOCOLS[0],
        help="budgeted: so many steps in batches; published: ContactNets', until the held-out loss stops falling; "
        "exact: a polytope's optimum at once (default budgeted)",
    )
    group.add_argument(
        "--steps",
        type=positive_integer,
        metavar="N",
        help="gradient steps at most, which exact takes none of (default: of the protocol)",
    )
    group.add_argument("--seed", type=natural_number, default=0, metavar="N", help="of everything random (default 0)")


def _add_toss_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("which tosses it learns from (default: all)")
    chosen = group.add_mutually_exclusive_group()
    chosen.add_argument("--manifest", type=Path, metavar="FILE", help="those that `rank` kept")
    chosen.add_argument("--top", type=positive_integer, metavar="K", help="the best K, as the model sees them")
    group.add_argument("--criterion", choices=criterion_names(), help=f"by what --top chooses (default {DEFAULT_CRITERION})")
    group.add_argument("--variant", choices=VARIANTS, help="of criterion orthogonal (default pivoted)")
    group.add_argument(
        "--estimator",
        choices=[estimator.value for estimator in Estimator],
        help="of the Fisher matrix for --top (default gauss-newton)",
    )
    again = group.add_mutually_exclusive_group()
    again.add_argument("--rerank-every", type=positive_integer, metavar="N", help="select the best K again every N epochs")
    again.add_argument("--canary", action="store_true", help="select them again when the ranks of a few tosses have moved")
    add_held_out_option(group, f"default {DEFAULT_SHARE}; with --manifest of the tosses that were not kept")
    group.add_argument("--keep-twins", action="store_true", help="learn from motions, too, that are held out under another id")
    group.add_argument("--no-gate", action="store_true", help="learn from what the gates would keep back, too")


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("output")
    group.add_argument(
        "--out", type=PathEndingIn(".safetensors"), required=True, metavar="CHECKPOINT", help="a .safetensors file"
    )
    exists = group.add_mutually_exclusive_group()
    exists.add_argument("--resume", action="store_true", help="go on where the checkpoint is, if there is one")
    exists.add_argument("--overwrite", action="store_true", help="begin anew although there is one")
    group.add_argument(
        "--checkpoint-every",
        type=number_from_zero,
        default=CHECKPOINT_SECONDS,
        metavar="SECONDS",
        help=f"(default {CHECKPOINT_SECONDS:g}); the result does not depend on it",
    )
    group.add_argument(
        "--metrics", type=PathEndingIn(".jsonl"), metavar="FILE.jsonl", help="a line of JSON for each evaluation and selection "
        "(default: beside the checkpoint)"
    )  # fmt: skip
    add_json_option(parser)
