"""What came of a session: one table for people, one object for programs."""

from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.cli.online.options import OnlineConfig
from contact_curation.contact.body import Body
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import Toss
from contact_curation.session.events import EventLog
from contact_curation.session.node_settings import judged_inputs
from contact_curation.session.session import Session, gains, outcome_of
from contact_curation.session.stores import Standing
from contact_curation.storage.inputs.inputs import open_inputs


@dataclass(frozen=True)
class Summary:
    """What came of a session.

    Attributes:
        document: all of it, as JSON has it.
        complete: whether all throws that were asked for were made.
    """

    document: dict[str, Any]
    complete: bool


def summary_of(
    config: OnlineConfig, body: Body, session: Session, checkpoint: Path, restarts: dict[str, int], events: EventLog
) -> Summary:
    """From what the nodes left.

    Args:
        config: what was asked for.
        body: that was thrown.
        session: at its end.
        checkpoint: the trainer's.
        restarts: of each node.
        events: of the session.
    """
    standing = session.standing
    made = standing.throws
    planned = [throw for throw in made if throw.planned is not None and throw.realised is not None]
    total = sum(throw.planned or 0.0 for throw in planned)
    document = {
        "throws": [_throw(standing, place) for place in range(len(made))],
        "wanted": config.throws,
        "designed": sum(throw.warm_up is None for throw in made),
        "planned_gain": total,
        "realised_gain": sum(throw.realised or 0.0 for throw in planned),
        "tosses": len(standing.tosses),
        "rejected": {one.toss_id: list(one.reasons) for one in standing.kept_back},
        "kept": list(standing.kept),
        "parameters_version": standing.version,
        "rounds": standing.training.round if standing.training else 0,
        "gradient_steps": standing.training.gradient_steps if standing.training else 0,
        "held_out": _held_out(config, checkpoint, body),
        "restarts": {name: count for name, count in restarts.items() if count},
        "settled": session.settled,
        "dashboard": session.address,
        "seconds": round(events.seconds, 1),
    }
    return Summary(document, complete=not config.throws or len(made) >= config.throws)


def print_summary(summary: Summary) -> None:
    """For people."""
    told = summary.document
    print()
    for throw in told["throws"]:
        print(f"   {throw['number']:>4}  {throw['gains']:<40}  {throw['outcome']}")
    print()
    for name, text in summary_lines(told):
        print(f"   {name:<12}  {text}")


def summary_lines(told: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and text of each fact."""
    throws, rejected = told["throws"], told["rejected"]
    restarts = ", ".join(f"{name} {count}" for name, count in told["restarts"].items()) or "none"
    lines = [
        ("throws", f"{len(throws)} made, {told['designed']} of them designed"),
        ("tosses", f"{told['tosses']} sound, {len(rejected)} rejected"),
        ("gain", _gain(told)),
        ("held out", _errors(told["held_out"])),
        ("buffer", f"{len(told['kept'])} of {told['tosses']} tosses kept"),
        ("training", f"{told['rounds']} rounds, {told['gradient_steps']} steps"),
        ("restarts", restarts),
        ("time", f"{told['seconds']:.0f} s" + ("" if told["settled"] else "; ended before all was at rest")),
    ]
    return lines + [(name, told[name]) for name in ("replay", "manifest", "report", "dashboard") if told.get(name)]


def _gain(told: dict[str, Any]) -> str:
    if not told["planned_gain"]:
        return "no designed throw was scored"
    ratio = told["realised_gain"] / told["planned_gain"]
    return f"planned {told['planned_gain']:.3g}, realised {told['realised_gain']:.3g} in log-det, {100.0 * ratio:.0f} %"


def _errors(errors: dict[str, Any] | None) -> str:
    if errors is None:
        return "no held-out recording, or nothing trained yet"
    numbers = f"position {errors['position']:.1f} %, rotation {errors['rotation']:.1f} degrees, loss {errors['loss']:.3g}"
    return f"{numbers}, mean over {errors['tosses']} tosses"


def _throw(standing: Standing, place: int) -> dict[str, Any]:
    throw = standing.throws[place]
    return {
        "number": place + 1,
        "throw": throw.throw_id,
        "kind": "designed" if throw.warm_up is None else "warm-up",
        "planned_gain": throw.planned,
        "realised_gain": throw.realised,
        "toss": throw.toss_id,
        "outcome": outcome_of(standing, place),
        "gains": gains(throw),
    }


def _held_out(config: OnlineConfig, checkpoint: Path, body: Body) -> dict[str, Any] | None:
    """Errors of the model in the checkpoint; None where there is none, or nothing to judge it by."""
    tosses = [one for one in open_inputs(config.held_out, body, judged_inputs(config)) if isinstance(one, Toss)]
    if not (tosses and checkpoint.exists()):
        return None
    from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
    from contact_curation.storage.checkpoint_file import read_model

    found = evaluate_model(read_model(checkpoint, body), tosses, EvaluationConfig())
    finite = found.errors.finite
    return {
        "position": _mean(found.errors.position[finite]),
        "rotation": _mean(found.errors.rotation[finite]),
        "loss": found.mean_loss if isfinite(found.mean_loss) else nan,
        "tosses": len(tosses),
    }


def _mean(values: Array) -> float:
    return float(np.mean(values)) if values.size else nan
