"""The functions of `import contact_curation as cc`; results are those of the commands, to the last digit.

Defaults are those of the commands, too, but that `train` holds no tosses out unless it is told to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

from contact_curation.configs import changed_fields, truth_value, whole_number
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.registry import DEFAULT_MODEL, model_entry
from contact_curation.contact.models.torch_state import own_torch
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.extras import says_what_to_install
from contact_curation.files import as_word, path_of
from contact_curation.information.network.config import CPU, Device, network_config_for
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.carried_body import ASSUMED, CarriedBody, GivenBody, body_of, carried_body
from contact_curation.pipeline.diagnosis import MOST_MESSAGES, Diagnosis, diagnose
from contact_curation.pipeline.division import DivisionConfig, HeldOut, held_out_rule, learning_tosses
from contact_curation.pipeline.ranked import RankedTosses
from contact_curation.pipeline.ranking import RankConfig, rank_tosses
from contact_curation.pipeline.reading import ReadingConfig, inputs_config
from contact_curation.pipeline.recordings.index import RecordingIndex
from contact_curation.pipeline.scoring import PoolConfig
from contact_curation.pipeline.theta import (
    Theta,
    described_polytope,
    form_of,
    learned_before,
    of_other_rigs,
    of_start,
    theta_of,
)
from contact_curation.pipeline.toss_scores import TossScores, toss_scores
from contact_curation.pipeline.tosses import Inputs, Tosses, checked_tosses, input_paths, read_tosses
from contact_curation.pipeline.workers import Progress, processes_for, silent
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.parameters_file import Parameters
from contact_curation.storage.throws_file import MOST_THROWS

if TYPE_CHECKING:  # torch takes over a second to import, which reading and ranking polytopes do without
    from contact_curation.pipeline.design import DesignedThrows
    from contact_curation.pipeline.evaluated import Evaluation
    from contact_curation.pipeline.learned_model import GivenModel, LearnedModel

NO_BODY = f"no body given: assuming {ASSUMED}"

BODY = "BODY"
"""Stands in a command for a body that is in memory."""

HELD_OUT = "held_out"
"""The parameter, for messages."""

RANKING, SCORING = RankingConfig(), ScoringConfig()
"""The defaults."""


@says_what_to_install
def read(
    inputs: Inputs,
    body: GivenBody | None = None,
    *,
    config: InputsConfig | Mapping[str, object] | None = None,
    jobs: int | None = 1,
    progress: Progress | None = None,
) -> Tosses:
    """Reads the tosses of recordings, and the rejected motions with their reasons.

    Args:
        inputs: an MCAP file, a rosbag2 folder or its storage file, a ROS 1 bag, a folder of ContactNets' `.pt` files or one of
            them; several of those; or a pattern such as ``"bags/*.mcap"``.
        body: the tossed object, or its file; None assumes ContactNets' cube, with a warning.
        config: settings by the names that `--set` takes (docs/ros/reference.md), such as
            ``{"poses.topic": "/my_tracker/brick", "gates.depth": 0.01}``, or an `InputsConfig`; None for the defaults.
        jobs: number of recordings that are read at the same time, each in a process; None as in `rank`.
        progress: shows the progress, as `contact_curation.pipeline.workers.Progress` describes; None shows nothing.

    Returns:
        The tosses: `accepted`, `rejected` with reasons, and `warnings`, among them a line for each recording that cannot be
        read. Positions are in metres on the board, orientations are quaternions wxyz.

    Raises:
        UnreadableInputError: nothing matches a pattern.
        InvalidValueError: an argument is not accepted, such as a setting that does not exist.

    Examples:
        >>> tosses = cc.read("session.mcap", body=body)
        >>> len(tosses.accepted), len(tosses.rejected)
        (21, 3)
        >>> tosses.accepted[0].positions.shape  # frames, [m]
        (100, 3)
        >>> tosses.rejected[0].reasons[0].split(":")[0]
        'displacement beside the velocity'
    """
    with (progress or silent)("reading", "tosses") as bar:
        paths = input_paths(inputs)
        found = read_tosses(paths, _reading(body, config), processes_for(paths, jobs), bar.advance)
    return found if body is not None else replace(found, warnings=(NO_BODY, *found.warnings))


@says_what_to_install
def check(
    inputs: Inputs,
    body: GivenBody | None = None,
    *,
    config: InputsConfig | Mapping[str, object] | None = None,
    most_messages: int = MOST_MESSAGES,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnoses recordings: finds what is wrong with them, before anything is learned from them.

    Args:
        inputs: as in `read`.
        body: the tossed object, or its file; None assumes ContactNets' cube, which is a warning.
        config: as in `read`.
        most_messages: largest number of messages with the object's pose that are read, the first ones of each recording.
        progress: shows the progress, as `contact_curation.pipeline.workers.Progress` describes; None shows nothing.

    Returns:
        `verdict` in one line, `ok`, `reasons`, the `settings` that correct what they can, and the `next` command; `print` shows
        them, `document()` gives them to programs.

    Raises:
        UnreadableInputError: nothing matches a pattern. A recording that cannot be read is in the diagnosis.

    Examples:
        >>> found = cc.check("session.mcap", body=body)
        >>> found.ok, found.verdict
        (True, 'ok: 21 of 24 motions are sound tosses of cube')
    """
    paths = input_paths(inputs)
    with (progress or silent)("checking", "recordings", len(paths)) as bar:
        reading = _reading(body, config)
        words = _options(body, reading.inputs)
        found = diagnose(paths, reading, words=words, most_messages=most_messages, advance=bar.advance)
    return found if body is not None else replace(found, warnings=(NO_BODY,))


@says_what_to_install
def score(
    tosses: Tosses | Inputs,
    *,
    body: GivenBody | None = None,
    model: "GivenModel | None" = None,
    estimator: str = SCORING.estimator.value,
    device: str = CPU,
) -> TossScores:
    """Scores tosses: computes the information that each one contains about theta (method.md 1.4 and 1.5).

    Args:
        tosses: tosses from `read`, or inputs as for `read`.
        body: the tossed object, or its file, if `tosses` are recordings; None for the model's body or, without a model,
            ContactNets' cube.
        model: the model with whose parameters theta the tosses are scored, or its file; None for the body as described.
        estimator: formula of the Fisher matrix: ``gauss-newton`` or ``empirical`` (method.md 1.5).
        device: where networks are evaluated: ``cpu``, ``cuda`` or ``cuda:N``.

    Returns:
        For each of K accepted tosses the score (a row of `scores`, (K, P)), a factor W (R, P) of its Fisher matrix WᵀW, and
        the losses (N,) of its N transitions, with the names and units of the P parameters.

    Raises:
        ContactCurationError: no toss was accepted, or the file contains no model.

    Examples:
        >>> info = cc.score(tosses)
        >>> info.scores.shape, info.parameter_names[0], info.parameter_units[0]
        ((21, 28), 'vertices_normal[0][0]', 'characteristic length')
        >>> info.factors[0].shape[1], len(info.losses[0])
        (28, 99)
    """
    place = Device(device)
    found = _tosses(tosses, _body(body, model, tosses)).check_some("no toss to score")
    config = _pool_config(found.config, _theta(model, found.body), estimator, place)
    with own_torch():
        (scorer,) = config.scorers(config.fixed_bounds, jobs=1)
        others = of_other_rigs([model], found.config.inputs.rig)
        return replace(toss_scores(scorer, found.accepted), warnings=(*others, *found.warnings))


@says_what_to_install
def rank(
    tosses: Tosses | Inputs,
    top: int = RANKING.top,
    *,
    body: GivenBody | None = None,
    criterion: str = RANKING.criterion,
    model: "GivenModel | None" = None,
    estimator: str = SCORING.estimator.value,
    device: str = CPU,
    seed: int = RANKING.seed,
    held_out: HeldOut | None = None,
    index: str | PathLike[str] | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> RankedTosses:
    """Ranks tosses by a criterion, and selects the first ones (method.md 2.3 and 2.9).

    Args:
        tosses: tosses from `read`, or inputs as for `read`; of those, at most 64 tosses of a recording are in memory at once.
        top: number of tosses to select.
        body: the tossed object, or its file, if `tosses` are recordings; None for the model's body or, without a model,
            ContactNets' cube.
        criterion: ``representative``, ``herding``, ``facility-location``, ``v-optimal``, ``log-det``, ``trace``, ``min-eig``,
            ``orthogonal``, ``leverage``, ``longest``, ``random``, or one of your own
            (`information.criteria.criterion.register`).
        model: the model whose parameters the information is about, or its file; None for the body as described.
        estimator: formula of the Fisher matrix: ``gauss-newton`` or ``empirical`` (method.md 1.5).
        device: where networks are evaluated: ``cpu``, ``cuda`` or ``cuda:N``.
        seed: random seed of the criterion ``random``.
        held_out: tosses that are not ranked, nor are their duplicates: numbers (``"400-569"``, 400 or ``range(400, 570)``), a
            share (0.2), or a file of ids.
        index: folder that keeps what was read and scored, so that a second ranking reads and scores only what changed; None for
            none, and for tosses from `read`.
        jobs: number of processes that read recordings; None for one per processor, as long as starting them saves time.
        progress: shows the progress, as `contact_curation.pipeline.workers.Progress` describes; None shows nothing.

    Returns:
        The ranking: `selected`, `selected_ids`, `to_pandas()`, `to_arrow()`, `plot()`, `save(path)`; `print` shows it.

    Raises:
        ContactCurationError: no toss could be ranked, a name is unknown, or the file contains no model.

    Examples:
        >>> ranking = cc.rank(tosses, top=8)
        >>> len(ranking.selected), ranking.selected_ids[0] in tosses.ids
        (8, True)
        >>> ranking.to_arrow().num_rows  # the rejected ones, too
        24
        >>> ranking.save("manifest.parquet")
    """
    if index is not None and isinstance(tosses, Tosses):
        raise InvalidValueError("index", fspath(index), "none for tosses that were read: give the recordings")
    source = tosses if isinstance(tosses, Tosses) else input_paths(tosses)
    known = _body(body, model, tosses)
    reading = tosses.config if isinstance(tosses, Tosses) else ReadingConfig(known or CONTACTNETS_CUBE)
    theta = _theta(model, reading.body)
    config = RankConfig(
        pool=_pool_config(reading, theta, estimator, Device(device)),
        ranking=RankingConfig(criterion=criterion, top=top, seed=seed),
        model=theta.kind if not isinstance(theta, Parameters) else DEFAULT_MODEL,
        parameters=f"body {reading.body.name}" if model is None else getattr(model, "name", str(model)),
        held_out=_held_out(held_out),
        jobs=jobs,
        index=None if index is None else RecordingIndex(path_of("index", index, "the path of a folder")),
        warnings=of_other_rigs([model], reading.inputs.rig),
    )
    with own_torch():
        ranked = rank_tosses(source, config, progress or silent)
    ranked.evidence()  # refuses where nothing was ranked
    return ranked if known or isinstance(tosses, Tosses) else replace(ranked, warnings=(NO_BODY, *ranked.warnings))


@says_what_to_install
def train(
    tosses: Tosses | Inputs,
    model: str = DEFAULT_MODEL,
    *,
    body: GivenBody | None = None,
    protocol: str = "auto",
    steps: int | None = None,
    seed: int = 0,
    held_out: HeldOut | None = None,
    start: "GivenModel | None" = None,
    restitution: bool = False,
    shape_known_to: float | None = None,
    progress: Progress | None = None,
) -> "LearnedModel":
    """Trains a model on tosses.

    Args:
        tosses: tosses to learn from: those of `read` or of `RankedTosses.selected`, or inputs as for `read`.
        model: ``polytope``, ``deep``, ``deepvertex`` or ``end_to_end``.
        body: the tossed object, or its file, if `tosses` are recordings; None for that of `start` or, without it, ContactNets'
            cube.
        protocol: ``exact`` fits a polytope to the optimum of its loss; ``budgeted`` makes a fixed number of gradient steps;
            ``published`` is ContactNets' protocol, which ends when the held-out loss stops falling; ``auto`` is ``exact`` for
            a polytope without `steps`, and else ``budgeted`` (method.md 1.12 and 2.10).
        steps: largest number of gradient steps; None for that of the protocol.
        seed: random seed of the initialisation and the order of batches.
        held_out: tosses that are not learned from: numbers, a share, or a file of ids, as in `rank`; None for none, where the
            command holds out a fifth.
        start: model of this kind to start from, or its file; None for the published random initialisation.
        restitution: whether a polytope learns a restitution, too, by the exact protocol. If it does not and the tosses bounce,
            `warnings` of the model say so.
        shape_known_to: how exactly the corners of the body (or of `start`) are known, their standard deviation [m]: the exact
            protocol begins there, and leaves corners there that the tosses say little of. None for the published random
            initialisation, which is off by 0.4 length scales.
        progress: shows the progress, as `contact_curation.pipeline.workers.Progress` describes; None shows nothing.

    Returns:
        The model; `save("model.safetensors")` stores it.

    Raises:
        ContactCurationError: there is no toss to learn from, a name is unknown, or a loss was not finite.

    Examples:
        >>> model = cc.train(ranking.selected)
        >>> model.kind, len(model.learned_from)
        ('polytope', 8)
        >>> model.save("model.safetensors")
    """
    from contact_curation.pipeline.learned_model import LearnedModel
    from contact_curation.pipeline.training import PROTOCOLS, TrainConfig, TrainingRun, protocol_named, start_of

    if start is not None and not isinstance(start, LearnedModel):
        start = path_of("start", start, "a model, or the path of its file")
    found = _tosses(tosses, _body(body, start, tosses))
    model_entry(model)  # refuses what is none
    load_kernel()
    config = PROTOCOLS[protocol_named(protocol, model, by_steps=steps is not None)](model)
    if config.exact and steps is not None:
        raise InvalidValueError("steps", "protocol exact, which takes none", "protocol budgeted or published")
    steps = config.steps if steps is None else steps
    division = DivisionConfig(_held_out(held_out), said=held_out is not None)
    learning = learning_tosses(found, division)
    budget = replace(config, steps=steps, restitution=truth_value("restitution", restitution), shape_known_to=shape_known_to)
    plan = TrainConfig(
        kind=model,
        body=found.body,
        protocol=budget,
        start=start_of(start, model, found.body),
        seed=seed,
        rig=found.config.inputs.rig,
        learned_before=learned_before(start),
    )
    with own_torch(), (progress or silent)("training", "steps", None if budget.exact else budget.steps) as bar:
        running = TrainingRun.begun(plan, learning)
        while running.running:
            bar.advance(1, running.advance())
        running.check()
        bounce = running.bounce()
        missing = bounce.in_words("restitution=True") if bounce and bounce.missing else running.sticking()
        others = of_start(start, found.config.inputs.rig, learning.held_out)
        return replace(running.model(), warnings=(*others, *learning.warnings, *filter(None, (missing,)), *running.doubts()))


@says_what_to_install
def evaluate(
    model: "GivenModel",
    tosses: Tosses | Inputs,
    *,
    against: "GivenModel | None" = None,
    held_out: HeldOut | None = None,
    more: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> "Evaluation":
    """Evaluates a model: predicts each toss from its first measured state, and compares with the measured motion.

    Args:
        model: the model, from `train` or `load_model`, or its file.
        tosses: tosses from `read`, or inputs as for `read`.
        against: another model, or its file, which is evaluated on the same tosses and compared.
        held_out: tosses to evaluate on: numbers, a share, or a file of ids, as in `rank`; None for those that the training held
            out; if it held out none, for those that it did not learn from, or all.
        more: number of further throws like those that an exact fit learned from; `more_throws` of the result predicts how far
            they would change predicted motions. None for as many again.
        seed: random seed of the bootstrap.
        progress: shows the progress, as `contact_curation.pipeline.workers.Progress` describes; None shows nothing.

    Returns:
        Errors of position and penetration [% of the body's width] and rotation [degrees] with 95 % intervals (method.md
        1.11). `print` shows them; `document()` returns them as an object for JSON.

    Raises:
        ContactCurationError: there is no toss to evaluate on, or the tosses are of another body.

    Examples:
        >>> report = cc.evaluate(model, cc.read("test.mcap", body=body))
        >>> report.evaluations[0].errors.position.shape  # [% of the width], one per toss
        (13,)
        >>> print(report)
        evaluated on 13 of 24 tosses (3 rejected: ...; 8 not chosen): polytope trained here did not learn from them
        ...
    """
    from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
    from contact_curation.pipeline.evaluation import evaluate_models, evaluation_config, judging_tosses
    from contact_curation.pipeline.learned_model import model_of

    load_kernel()
    first = model_of(model, tosses.body if isinstance(tosses, Tosses) else None)
    models = [first] if against is None else [first, model_of(against, first.body)]
    config = evaluation_config(bootstrap=BootstrapConfig(seed=seed))
    with own_torch():
        found = _tosses(tosses, first.body)
        for one in (model, against):
            _body(None, one, found)
        judged = judging_tosses(found, held_out, models, HELD_OUT)
        return evaluate_models(models, judged, config, progress=progress or silent, more=more)


@says_what_to_install
def design(
    model: "GivenModel | Sequence[GivenModel] | None" = None,
    *,
    known: Tosses | Sequence[Toss] = (),
    throws: int = 8,
    body: GivenBody | None = None,
    method: str = "information",
    arm: bool = False,
    seed: int = 0,
    name: str = "throw",
    progress: Progress | None = None,
) -> "DesignedThrows":
    """Designs the throws that together have the largest predicted information gain (method.md 1.10).

    Args:
        model: a polytope, its file, or several of them, over which gains are averaged; None for the body as described.
        known: tosses that have been selected so far.
        throws: number of throws.
        body: the object to throw, or its file, if there is no model; None for ContactNets' cube.
        method: ``information``; ``exploration``, which chooses different first impacts while theta is unknown; ``paper`` and
            ``prior`` are baselines.
        arm: whether only throws are designed that the simulated arm can make.
        seed: random seed; the same seed gives the same throws.
        name: beginning of the throws' ids.
        progress: shows the progress, as `contact_curation.pipeline.workers.Progress` describes; None shows nothing.

    Returns:
        The throws, best first: release pose [m], linear [m/s] and angular [rad/s] velocity, and predicted gain in log-det of
        each; `save("throws.json")` stores them.

    Raises:
        ContactCurationError: a model is not a polytope, or no throw is safe.

    Examples:
        >>> throws = cc.design(known=ranking.selected, throws=2, method="prior")
        >>> [throw.throw_id for throw in throws]
        ['throw-0-0', 'throw-0-1']
        >>> throws.save("throws.json")
    """
    from contact_curation.pipeline.design import DesignTask, design_throws
    from contact_curation.pipeline.learned_model import model_of

    load_kernel()
    throws = whole_number("throws", throws, 1, MOST_THROWS)
    given = None if body is None else body_of(body)
    several = model if isinstance(model, Sequence) and not isinstance(model, str) else [model]
    for one in several:
        _body(given, one, known if isinstance(known, Tosses) else ())
    models = [model_of(one, given) for one in several if one is not None]
    with own_torch():
        thetas = tuple(map(_polytope, models)) or (described_polytope(given or CONTACTNETS_CUBE),)
    task = DesignTask(thetas, _by_id(known), method=method, arm=truth_value("arm", arm), seed=seed, name=name)
    with (progress or silent)("designing", "simulated throws", task.simulations(throws)) as bar:
        found = design_throws(task, throws, bar.advance)
    return found if models or given else replace(found, warnings=(NO_BODY,))


def _reading(body: GivenBody | None, config: InputsConfig | Mapping[str, object] | None) -> ReadingConfig:
    return ReadingConfig(CONTACTNETS_CUBE if body is None else body_of(body), inputs_config(config))


def _options(body: GivenBody | None, config: InputsConfig) -> list[str]:
    """The options by which a command is told the same."""
    file = BODY if isinstance(body, Body) else as_word(body)
    named = [] if body is None or body is CONTACTNETS_CUBE else ["--body", file]
    return [*named, *(word for setting in changed_fields(config, InputsConfig()) for word in ("--set", setting))]


def _tosses(tosses: Tosses | Inputs, body: Body | None) -> Tosses:
    return tosses if isinstance(tosses, Tosses) else read(tosses, body)


def _by_id(known: object) -> tuple[Toss, ...]:
    by_id = {toss.toss_id: toss for toss in checked_tosses("known", known)}
    return tuple(by_id[toss_id] for toss_id in sorted(by_id))


def _held_out(spec: HeldOut | None) -> HeldOutRule:
    return HeldOutRule() if spec is None else held_out_rule(spec, HELD_OUT)


def _body(body: GivenBody | None, model: "GivenModel | None", tosses: Tosses | Inputs = ()) -> Body | None:
    """The given body, or that of the model; None without either.

    Raises:
        InvalidValueError: the given body is another one than that of the model or of the tosses.
    """
    given = None if body is None else CarriedBody(body_of(body), "the parameter body")
    files, known = [], []
    if isinstance(model, str | PathLike):
        files.append(Path(model))
    elif model is not None:
        from contact_curation.pipeline.learned_model import model_of

        known.append(CarriedBody(model_of(model).body, model.name))
    if isinstance(tosses, Tosses):
        known.append(CarriedBody(tosses.body, "the tosses"))
    found = carried_body(files, given=given, known=known)
    return found.body if found else None


def _theta(model: "GivenModel | None", body: Body) -> Theta:
    if model is None:
        return described_polytope(body)
    from contact_curation.pipeline.learned_model import model_of

    with own_torch():
        return theta_of(model_of(model, body).model)


def _pool_config(reading: ReadingConfig, theta: Theta, estimator: str, device: Device) -> PoolConfig:
    if estimator not in tuple(Estimator):
        raise UnknownNameError("estimator", estimator, Estimator)
    network = network_config_for(DEFAULT_MODEL if isinstance(theta, Parameters) else theta.kind)
    scoring = ScoringConfig(estimator=Estimator(estimator), form=form_of(None, (theta,)))
    return PoolConfig(reading, (theta,), scoring, network=network, device=device)


def _polytope(model: "LearnedModel") -> Parameters:
    theta = theta_of(model.model)
    if not isinstance(theta, Parameters):
        raise InvalidValueError("model to design throws for", model.kind, "a polytope")
    return theta
