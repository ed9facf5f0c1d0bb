"""`reproduce EXPERIMENT INPUT... --out DIR`: an experiment of the paper's or ours, from its tosses to tables and figures."""

import os
from pathlib import Path

from contact_curation.cli.options.body import DETAILS
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.reading import POSES, SHARED_STAGES, add_held_out_option, add_reading_options
from contact_curation.cli.options.types import Arguments, natural_number, number_from_zero, positive_integer
from contact_curation.cli.report import add_json_option
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.rules import BUDGET, PUBLIC_HELD_OUT

OF_A_BODY = ("dataset-quality", "functionals", "robustness", "designed-throws", "theorem", "calibration")
OVER_BODIES = ("counterfactuals", "criteria", "against-sysid")
"""Experiments that have their own bodies and tosses."""

EXPERIMENTS = (*OF_A_BODY, *OVER_BODIES)
LEARNING = ("dataset-quality", "functionals", "robustness", "designed-throws")
READ_BY = {
    **dict.fromkeys(("inputs", "body", *DETAILS, *POSES, "settings", "held_out", "as_recorded"), OF_A_BODY),
    **dict.fromkeys(("model", "protocol", "steps"), LEARNING),
    "rules": tuple(name for name in EXPERIMENTS if name not in ("calibration", "counterfactuals")),
    "seeds": tuple(name for name in EXPERIMENTS if name != "counterfactuals"),
    "shares": ("robustness",),
    "worlds": ("designed-throws",),
    "restitution": ("designed-throws",),
    "resamples": ("calibration",),
    "bodies": OVER_BODIES,
    "refits": ("counterfactuals",),
    "at_fit": ("criteria",),
}
"""Experiments that read an option, for the options that not all of them read."""

PUBLIC_DATA, TOSSES = "CONTACTNETS_DATA", "tosses_processed"
"""Where ContactNets' tosses are."""


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Runs an experiment cell by cell: a rule selects tosses, a model is trained on them and evaluated on held-out motion. "
        "Each finished cell is a line of DIR/cells.jsonl, from which the same command continues after a stop. At the end it "
        "writes rows.csv, summary.csv (medians over seeds, differences to random and longest, 95 % bootstrap intervals) and "
        "figure.png. In designed-throws the rules are ways to choose throws of a simulated arm, the sizes are numbers of "
        "throws, and a third of the tosses for training, drawn by the seed, judges. counterfactuals refits a polytope "
        "exactly on random subsets of bodies' tosses, and says how well scores of tosses foresee the errors; criteria "
        "compares rules on these bodies, judged by two engines; against-sysid compares the exact fit with MuJoCo's "
        "system identification and CMA-ES on those that are boxes. These three take no INPUT. "
        f"Without INPUT reproduce reads ContactNets' tosses in folder {TOSSES}/ of the folder that {PUBLIC_DATA} names."
    )
    parser.add_argument("experiment", choices=EXPERIMENTS, metavar="EXPERIMENT", help=", ".join(EXPERIMENTS))
    add_reading_options(parser, SHARED_STAGES, needed=False)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    group = parser.add_argument_group("what is run (defaults: docs/results.md)")
    add_held_out_option(group, f"default {PUBLIC_HELD_OUT}")
    group.add_argument(
        "--as-recorded",
        action="store_true",
        help="do not apply the rig calibration that is estimated from the tosses (docs/results.md)",
    )
    group.add_argument("--rules", nargs="+", metavar="RULE", help="that are compared")
    group.add_argument("--sizes", nargs="+", type=natural_number, metavar="K", help="of the selected sets; 0 for all")
    group.add_argument("--seeds", type=positive_integer, metavar="N", help="how many")
    group.add_argument("--model", help="what learns (default polytope)")
    group.add_argument(
        "--protocol",
        choices=("exact", "budgeted", "published"),
        help="to the optimum (polytope only, and its default), equal gradient steps, or ContactNets' protocol",
    )
    group.add_argument("--steps", type=positive_integer, metavar="N", help=f"of protocol budgeted (default {BUDGET})")
    group.add_argument("--shares", nargs="+", type=number_from_zero, metavar="X", help="of bad tosses (robustness)")
    group.add_argument("--worlds", nargs="+", metavar="WORLD", help="firm, soft, bouncing, springy (designed-throws)")
    group.add_argument("--restitution", action="store_true", help="learners have a restitution (designed-throws)")
    group.add_argument("--resamples", type=positive_integer, metavar="N", help="of the bootstrap (calibration)")
    group.add_argument("--bodies", nargs="+", metavar="BODY", help="cube, square, slab, wedge, irregular")
    group.add_argument("--refits", type=positive_integer, metavar="N", help="of each body (counterfactuals; default 400)")
    group.add_argument("--at-fit", action="store_true", help="select at the fit to all tosses (criteria)")
    group.add_argument("--quick", action="store_true", help="two tosses a set and two seeds if not given, to see that it works")
    group.add_argument("--jobs", type=positive_integer, default=1, metavar="N", help="cells at once (default 1)")
    add_json_option(parser)
    parser.set_examples(
        "contact-curation reproduce dataset-quality --out results --quick",
        "contact-curation reproduce robustness tosses.mcap --seeds 3 --jobs 2 --out results",
    )
    parser.set_defaults(run=run)


def run(arguments: Arguments) -> int:
    """Reads, runs what is not finished, and writes tables and figures.

    Raises:
        ContactCurationError: the tosses or the options cannot be used, or the folder belongs to another experiment.
    """
    _refuse_unread(arguments)
    if arguments.experiment == "counterfactuals":
        from contact_curation.experiments.counterfactuals.run import run_counterfactuals

        return run_counterfactuals(arguments)
    if arguments.experiment == "criteria":
        from contact_curation.experiments.comparison.run import run_comparison

        return run_comparison(arguments)
    if arguments.experiment == "against-sysid":
        from contact_curation.experiments.against_sysid.run import run_against_sysid

        return run_against_sysid(arguments)
    if not arguments.inputs:
        arguments.inputs = [_public_tosses()]
    from contact_curation.experiments.run import run_experiment  # torch takes over a second, which --help need not wait for

    return run_experiment(arguments)


def _refuse_unread(arguments: Arguments) -> None:
    """An option that the experiment would ignore is an error."""
    for name, experiments in READ_BY.items():
        if arguments.experiment not in experiments and getattr(arguments, name, None):
            option = "INPUT" if name == "inputs" else f"--{'set' if name == 'settings' else name.replace('_', '-')}"
            raise InvalidValueError(option, arguments.experiment, f"{' or '.join(experiments)}, which it belongs to")


def _public_tosses() -> Path:
    """The folder that the environment names."""
    folder = os.environ.get(PUBLIC_DATA, "")
    if not folder:
        raise InvalidValueError(
            "INPUT", f"none, and no {PUBLIC_DATA}", f"recordings, or {PUBLIC_DATA}: a folder with {TOSSES}/"
        )
    return Path(folder) / TOSSES
