"""Errors: messages for names that do not exist, and the way from one process to another."""

import pickle
from pathlib import Path

import pytest

from contact_curation import errors
from contact_curation.contact.body_values import MissingKeyError
from contact_curation.errors import (
    ChangedTossError,
    ContactCurationError,
    InvalidValueError,
    MissingDependencyError,
    MissingTopicError,
    NewerVersionError,
    NothingFoundError,
    NotScoredError,
    UnknownNameError,
    UnloadableLibraryError,
    UnreadableInputError,
    UnwritableOutputError,
    did_you_mean,
    why_unreadable,
)
from contact_curation.pipeline.workers import Advance, LocalEngine, WorkerDiedError, unheard


def test_the_nearest_known_name_is_offered_whatever_its_case() -> None:
    assert did_you_mean("'vertexes'", ["'mass'", "'vertices'"]) == "did you mean 'vertices'?"
    assert did_you_mean("MASS", ["mass", "vertices"]) == "did you mean mass?"


def test_without_a_near_name_all_known_ones_are_listed() -> None:
    assert did_you_mean("colour", ["mass", "friction"]) == "expected one of friction, mass"


def test_an_unknown_name_is_an_invalid_value_in_one_line() -> None:
    with pytest.raises(InvalidValueError) as caught:
        raise UnknownNameError("field", "gates.dpth", ["gates.depth", "gates.spin"])
    assert str(caught.value) == "unknown field gates.dpth: did you mean gates.depth?"


def test_a_link_to_nothing_says_where_it_leads_and_offers_no_name(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").symlink_to("annex/a.mcap")
    found = why_unreadable(tmp_path / "a.mcap", FileNotFoundError(2, "No such file or directory"))
    assert found == "No such file or directory; it is a link to annex/a.mcap"


ERRORS = [
    ContactCurationError("one\nline"),
    InvalidValueError("mass", -1, "a positive number"),
    UnwritableOutputError("m.json", "No space left on device"),
    UnknownNameError("field", "gates.dpth", ["gates.depth", "gates.spin"]),
    UnreadableInputError("a.mcap", "is cut off"),
    ChangedTossError("a.mcap", "cube-1"),
    NewerVersionError("a.json", "a manifest", 3, 2),
    MissingTopicError("a.mcap", "/odom", []),
    UnloadableLibraryError("torch/_C.so", "libtorch_cpu.so: failed to map segment"),
    MissingDependencyError("mujoco", "pip install mujoco"),
    NotScoredError("cube-1", "it has no transition"),
    NothingFoundError("found no toss", ["a.mcap is empty"]),
    WorkerDiedError(2),
    MissingKeyError({"mass": "0.3"}),
]


def test_every_error_of_this_module_is_among_those_that_are_pickled() -> None:
    here = {kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, ContactCurationError)}
    assert here <= {type(error) for error in ERRORS}


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_an_error_is_the_same_in_another_process(error: ContactCurationError, protocol: int) -> None:
    other = pickle.loads(pickle.dumps(error, protocol))
    assert type(other) is type(error)
    assert str(other) == str(error)
    assert vars(other) == vars(error)


def refuses(place: int, advance: Advance) -> int:
    raise NewerVersionError(f"{place}.json", "a manifest", 3, 2)


@pytest.mark.slow
def test_an_error_in_a_worker_process_is_the_one_that_is_raised_here() -> None:
    with pytest.raises(NewerVersionError, match=r"^\d\.json: found version 3 of a manifest") as caught:
        list(LocalEngine(2).as_done(refuses, [0, 1], unheard))
    assert caught.value.path.suffix == ".json"
