"""`score INPUT... --params FILE --out FILE.npz`: writes loss terms, impulses and scores of each transition."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import batched, pairwise
from pathlib import Path

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.reading import add_reading_options, inputs_of, stages_of
from contact_curation.cli.options.settings import add_fields, with_options
from contact_curation.cli.options.types import PathEndingIn
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.contact.evaluation import Evaluation, SolveStatus, evaluate
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of
from contact_curation.pipeline.diagnosis.explained import explained
from contact_curation.pipeline.reading import InputReader, ReadingConfig
from contact_curation.pipeline.theta import of_other_rigs, polytope_of
from contact_curation.pipeline.tosses import CHECK_SAYS, EachOnce
from contact_curation.pipeline.wording import counted_tosses, nothing_found
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.parameters_file import Parameters
from contact_curation.storage.score_file import ScoreFileWriter

BATCH = 64
"""Number of tosses that are scored in one call."""


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Writes the loss terms, impulses and scores of every transition of every toss. No quality check is applied. A "
        "transition whose impulses have no certificate is written with its status, and counted."
    )
    add_reading_options(parser, ("poses", "segmenter", "loss"))
    parser.add_argument(
        "--params",
        "--checkpoint",
        dest="params",
        type=Path,
        required=True,
        metavar="FILE",
        help="parameters: a JSON file or a polytope's checkpoint",
    )
    add_fields(parser, LossConfig(), "cone")
    parser.add_argument("--out", type=PathEndingIn(".npz"), required=True, metavar="FILE.npz", help="file for the arrays")
    add_overwrite_option(parser)
    add_json_option(parser)
    parser.set_examples(
        "contact-curation score session.mcap --params theta.json --out scores.npz",
        "contact-curation score session.mcap --params model.safetensors --cone polyhedral --out scores.npz",
    )
    parser.set_defaults(run=run)


@dataclass
class Tally:
    """What was scored so far.

    Attributes:
        tosses: number of tosses.
        statuses: number of transitions by `SolveStatus`.
        loss: sum over the solved transitions.
        rejected: number of motions that are no tosses.
        repeated: number of tosses that occurred before.
        inputs: number of inputs that were read to their end.
        failed: number of inputs that could not be read.
        warnings: what was left out or lost, one line each.
    """

    tosses: int = 0
    statuses: Counter[int] = field(default_factory=Counter)
    loss: float = 0.0
    rejected: int = 0
    repeated: int = 0
    inputs: int = 0
    failed: int = 0
    warnings: list[str] = field(default_factory=list)

    def add(self, tosses: int, evaluation: Evaluation) -> None:
        self.tosses += tosses
        self.statuses.update(evaluation.status.tolist())
        self.loss += float(evaluation.losses[evaluation.solved].sum())


def run(arguments: argparse.Namespace) -> int:
    """Scores all inputs, writes the arrays, and prints a summary.

    Raises:
        ContactCurationError: nothing could be scored, or the file cannot be written.
    """
    load_kernel()  # an error should come before tosses are read
    check_outputs(overwrite=arguments.overwrite, out=arguments.out)
    body = chosen_body(arguments, models=[arguments.params])
    theta = polytope_of(arguments.params, body)
    stages = stages_of(arguments, {"loss": with_options(LossConfig(), arguments, "cone")})
    inputs = replace(inputs_of(stages, gated=False), as_stored=True)
    tally = Tally(warnings=list(of_other_rigs([arguments.params], inputs.rig)))
    names = parameter_form(replace(theta.geometry, restitution=None), Form.CONTACTNETS).names()
    names += () if theta.geometry.restitution is None else ("height", "restitution")
    with ScoreFileWriter(arguments.out, names) as writer, Progress("scoring", "tosses") as progress:
        tosses = _tosses(arguments.inputs, ReadingConfig(body, inputs), tally)
        for batch in batched(tosses, BATCH):
            tally.add(len(batch), _score(batch, theta, stages["loss"], writer))
            progress.advance(len(batch), share=tally.inputs / len(arguments.inputs))
        if not tally.statuses:
            nothing = nothing_found(arguments.inputs, tally.warnings, "no toss that could be scored", CHECK_SAYS)
            raise explained(nothing, arguments.inputs, ReadingConfig(body, inputs_of(stages)))
    warn(tally.warnings)
    _report(arguments, stages["loss"].cone.value, tally)
    return 0


def _tosses(paths: Sequence[Path], config: ReadingConfig, tally: Tally) -> Iterator[Toss]:
    """The tosses of all inputs, each once; what is left out is counted in `tally`."""
    once = EachOnce()
    for path in paths:
        reader = InputReader(path, config)
        yield from (toss for toss in reader.tosses() if once.takes(toss.toss_id, toss.digest(), str(path)))
        reading = reader.reading()
        tally.warnings += once.left_out[tally.repeated :]
        tally.repeated = len(once.left_out)
        tally.rejected += sum(bool(seen.reasons) for seen in reading.seen)
        tally.inputs += 1
        tally.failed += not reading.complete
        tally.warnings += reading.warnings


def _score(tosses: Sequence[Toss], theta: Parameters, config: LossConfig, writer: ScoreFileWriter) -> Evaluation:
    """Scores a batch and writes it, toss by toss."""
    rows: Transitions = transitions_of(tosses, theta.body.length_scale)
    evaluation = evaluate(theta.geometry, theta.body, rows.before, rows.after, rows.dt, config)
    numbers = rows.index_in_toss
    for toss_id, (start, stop) in zip(rows.toss_ids, pairwise(rows.starts.tolist())):
        part = {each.name: getattr(evaluation, each.name)[start:stop] for each in fields(evaluation)}
        writer.add(toss_id, numbers[start:stop], Evaluation(**part))
    return evaluation


def _report(arguments: argparse.Namespace, cone: str, tally: Tally) -> None:
    total, solved = tally.statuses.total(), tally.statuses[SolveStatus.SOLVED]
    content = {
        "out": str(arguments.out),
        "params": str(arguments.params),
        "cone": cone,
        "tosses": tally.tosses,
        "transitions": total,
        "not_solved": total - solved,
        "mean_loss": tally.loss / max(solved, 1),
        "rejected": tally.rejected,
        "repeated": tally.repeated,
        "inputs": len(arguments.inputs),
        "failed_inputs": tally.failed,
        "warnings": tally.warnings,
    }
    if arguments.json:
        print_json(content)
        return
    print(f"{arguments.out}: {total} transitions of {counted_tosses(tally.tosses)}, mean loss {content['mean_loss']:.6g}")
    print(f"not solved: {total - solved} transitions; they are written with their status")
    if tally.rejected or tally.repeated or tally.failed:
        print(f"left out: {tally.rejected} motions that are no tosses, {tally.repeated} repeated tosses, {tally.failed} inputs")
