"""The summary of a session: one record, as a table and as a JSON object."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.learned import HeldOutSummary, LearnedSummary, learned_of
from contact_curation.session.state import SessionState
from contact_curation.stages.records import ThrowRecord

INTERRUPTED = "; interrupted before everything was scored and trained on"


@dataclass(frozen=True)
class ThrowOutcome:
    """A throw and its outcome.

    Attributes:
        number: from 1.
        throw: its name.
        kind: why it was chosen.
        planned_gain: in log-det; None for exploration.
        realised_gain: of its toss; None where it is not known, and for exploration.
        toss: its toss; empty without one.
        outcome: of its toss, in words.
        gains: both gains, in words.
    """

    number: int
    throw: str
    kind: str
    planned_gain: float | None
    realised_gain: float | None
    toss: str
    outcome: str
    gains: str


@dataclass(frozen=True)
class Replay:
    """Result of ranking a session's bag offline.

    Attributes:
        same: whether the session's own ranking.
        replay: the same in words.
        manifest: file; empty where it could not be ranked.
    """

    same: bool
    replay: str
    manifest: str = ""


@dataclass(frozen=True)
class SessionSummary:
    """The summary of a session.

    Attributes:
        throws: that were made.
        wanted: how many were asked for; 0: no end.
        designed: how many of them were.
        planned_gain: of all whose gain is known.
        realised_gain: of those.
        tosses: that passed the gates.
        rejected: reasons by id, of the motions that did not.
        selected: ids of the buffer, best first.
        parameters_version: of the theta that they are ranked at.
        rounds: of training.
        gradient_steps: taken.
        held_out: errors of the trained model; None without recordings, or before it was trained.
        learned: parameters of the trained model; None before it was trained, and for a network.
        restarts: how often each node was started again, if it was.
        settled: whether everything had come to rest.
        dashboard: its address, as long as it is served; empty without one.
        seconds: it took.
        replay: of its bag; None where it was not recorded.
        folder: of the record.
        report: file.
    """

    throws: tuple[ThrowOutcome, ...]
    wanted: int
    designed: int
    planned_gain: float
    realised_gain: float
    tosses: int
    rejected: Mapping[str, tuple[str, ...]]
    selected: tuple[str, ...]
    parameters_version: str
    rounds: int
    gradient_steps: int
    held_out: HeldOutSummary | None
    learned: LearnedSummary | None
    restarts: Mapping[str, int]
    settled: bool
    dashboard: str
    seconds: float
    replay: Replay | None = None
    folder: str = ""
    report: str = ""

    @property
    def complete(self) -> bool:
        """Whether all throws that were asked for were made."""
        return len(self.throws) >= self.wanted

    def document(self) -> dict[str, Any]:
        """All of it, as JSON has it."""
        content = asdict(self) | {"learned_sentence": str(self.learned or "")}
        replay = content.pop("replay") or {}
        optional = {**replay, **{name: content.pop(name) for name in ("folder", "report")}}
        return content | {name: value for name, value in optional.items() if value != ""}

    def facts(self) -> list[tuple[str, str]]:
        """Name and text of each, for people."""
        restarts = ", ".join(f"{name} {count}" for name, count in self.restarts.items()) or "none"
        files = [] if self.replay is None else [("replay", self.replay.replay), ("manifest", self.replay.manifest)]
        lines = [
            ("throws", f"{len(self.throws)} made, {self.designed} of them designed"),
            ("tosses", f"{self.tosses} sound, {len(self.rejected)} rejected"),
            ("gain", self._gain()),
            ("learned", str(self.learned or "")),
            ("held out", self._errors()),
            ("buffer", f"{len(self.selected)} of {self.tosses} tosses selected"),
            ("training", f"{self.rounds} rounds, {self.gradient_steps} steps"),
            ("restarts", restarts),
            (
                "time",
                f"{self.seconds:.0f} s" + ("" if self.settled else "; interrupted before everything was scored and trained on"),
            ),
            *files,
            ("report", self.report),
            ("dashboard", self.dashboard),
        ]
        return [(name, text) for name, text in lines if text]

    def table(self) -> str:
        """For people: a line for each throw, and one for each fact."""
        throws = [f"   {one.number:>4}  {one.gains:<40}  {one.outcome}" for one in self.throws]
        return "\n".join(["", *throws, "", *(f"   {name:<12}  {text}" for name, text in self.facts())])

    def _gain(self) -> str:
        if not self.planned_gain:
            return "no designed throw was scored"
        share = 100.0 * self.realised_gain / self.planned_gain
        return f"planned {self.planned_gain:.3g}, realised {self.realised_gain:.3g} in log-det, {share:.0f} %"

    def _errors(self) -> str:
        if self.held_out is None:
            return "no held-out recording, or nothing trained yet"
        errors = self.held_out
        numbers = f"position {errors.position:.1f} %, rotation {errors.rotation:.1f} degrees, loss {errors.loss:.3g}"
        return f"{numbers}, mean over {errors.tosses} tosses"


def summary_of(
    config: SessionConfig,
    state: SessionState,
    folder: SessionFolder,
    restarts: Mapping[str, int],
    seconds: float,
    *,
    settled: bool,
) -> SessionSummary:
    """Makes the summary from the records of the nodes.

    Args:
        config: what was asked for.
        state: of the session at its end.
        folder: of the session.
        restarts: of each node.
        seconds: since it began.
        settled: whether everything had come to rest.
    """
    held_out, learned = learned_of(config, folder, state)
    scored = [throw for throw in state.throws if throw.realised_gain is not None]
    return SessionSummary(
        throws=tuple(_throw(state, place) for place in range(len(state.throws))),
        wanted=config.throws or 0,
        designed=sum(throw.exploration is None for throw in state.throws),
        planned_gain=sum(throw.planned_gain or 0.0 for throw in scored),
        realised_gain=sum(throw.realised_gain or 0.0 for throw in scored),
        tosses=len(state.tosses),
        rejected=dict(state.rejected),
        selected=state.buffer.selected,
        parameters_version=state.buffer.version,
        rounds=state.training.round,
        gradient_steps=state.training.gradient_steps,
        held_out=held_out,
        learned=learned,
        restarts={name: count for name, count in restarts.items() if count},
        settled=settled,
        dashboard=state.dashboard,
        seconds=round(seconds, 1),
    )


def gains(throw: ThrowRecord) -> str:
    """Planned and realised gain of a throw, in words."""
    if throw.planned_gain is None:
        return throw.report.kind.value
    realised = "none known" if throw.realised_gain is None else f"{throw.realised_gain:.3g} realised"
    return f"gain {throw.planned_gain:.3g} planned, {realised}"


def outcome_of(state: SessionState, place: int) -> str:
    """The outcome of the toss of a throw, in words."""
    throw, selected = state.throws[place], state.buffer.selected
    if throw.toss_id in selected:
        return f"selected, rank {selected.index(throw.toss_id) + 1} of {len(selected)}"
    if throw.toss_id:
        return "not selected"
    return f"rejected: {throw.rejected[0]}" if throw.rejected else "no motion was seen"


def _throw(state: SessionState, place: int) -> ThrowOutcome:
    throw = state.throws[place]
    return ThrowOutcome(
        number=place + 1,
        throw=throw.commanded.throw_id,
        kind=throw.report.kind.value,
        planned_gain=throw.planned_gain,
        realised_gain=throw.realised_gain,
        toss=throw.toss_id,
        outcome=outcome_of(state, place),
        gains=gains(throw),
    )
