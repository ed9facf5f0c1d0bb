"""The test vectors of conformance/: they come out of their definition again, and three other ways find the same values."""

import itertools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.evaluation import Cone
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.torch_contacts import Frames, Theta, contacts_of
from contact_curation.contact.torch_loss import cone_problems
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.certificate import objectives
from test.conformance.vectors import FOLDER, GROUPS, problems, script
from test.contact.torch_evaluation import evaluate_in_torch, loss_terms
from test.contact.torch_fisher import profile_fishers
from test.solver.reference import clarabel_impulses

IDS = sorted(problems())
QUICK = [key for key in IDS if len(problems()[key]["theta"]["vertices_normal"]) <= 2]
"""Those that the reference answers in a second or less, some of each group."""

THEIR_PARAMETERS = ("vertices_normal", "zvec", "vertices_tangent", "xyvecs")
STATE = ("position", "quaternion", "linear_velocity", "angular_velocity")


def posed(given: dict[str, Any]) -> tuple[ContactGeometry, Body, Array, Array, LossConfig]:
    """What the package needs of a problem."""
    theta = {name: np.array(value) for name, value in given["theta"].items()}
    geometry = ContactGeometry(**{**theta, "height": given["theta"]["height"]})
    body = Body("body", CONTACTNETS_CUBE.vertices, given["mass"], np.array(given["inertia"]), 0.0, 1.0, given["gravity"])
    before, after = (np.concatenate([given[when][name] for name in STATE])[None] for when in ("before", "after"))
    return geometry, body, before, after, LossConfig(**given["weights"], cone=Cone(given["cone"]["kind"]))


def whole(triangle: list[list[float]]) -> Array:
    """The symmetric matrix of a lower triangle."""
    found = np.zeros((len(triangle), len(triangle)))
    for k, row in enumerate(triangle):
        found[k, : k + 1] = found[: k + 1, k] = row
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("toss", "row"), [(0, 60), (17, 22)])
def test_the_definition_gives_the_losses_of_contactnets_own_code(contactnets_folder: Path, toss: int, row: int) -> None:
    path = contactnets_folder.parent / "reference_seed0.npz"
    if not path.exists():
        pytest.skip(f"{path.name} is not beside the tosses")
    theirs, given = np.load(path), dict(problems()["learned-10"])
    given["weights"] = {**given["weights"], "regularization": 1e-10}  # they have none
    own, normal, tangent, axes = (theirs[f"param/{name}"] for name in THEIR_PARAMETERS)
    poses = torch.load(contactnets_folder / f"{toss}.pt", weights_only=True)[0].numpy()
    body = CONTACTNETS_CUBE
    given["theta"] = {
        "vertices_normal": own.tolist(),
        "normal": normal[0].tolist(),
        "vertices_tangent": tangent.tolist(),
        "tangents": axes.tolist(),
        "pivot": [0.0, 0.0, 0.0],
        "height": 0.0,
    }
    for when, at in (("before", poses[row]), ("after", poses[row + 1])):
        given[when] = dict(zip(STATE, (part.tolist() for part in np.split(at[:13], (3, 7, 10))), strict=True))
    given |= {"dt": 1.0 / 148.0, "gravity": body.scaled_gravity, "mass": body.mass, "inertia": body.scaled_inertia.tolist()}
    reference = script("reference")
    found = reference.expected(reference.problem_of(given))
    assert found["loss"] == pytest.approx(float(theirs[f"toss{toss}/gold/loss/surr_qp"][row]), rel=1e-6)


def test_there_are_220_problems_half_of_them_with_each_cone() -> None:
    assert len(IDS) == 220
    assert sum(one["cone"]["kind"] == "circular" for one in problems().values()) == 110
    assert set(GROUPS) == set(script("generate").GROUPS)


@pytest.mark.parametrize("key", QUICK)
def test_a_problem_and_its_answer_come_out_of_the_seed_again_digit_by_digit(key: str) -> None:
    group, _, number = key.rpartition("-")
    assert script("generate").made(group, int(number)) == problems()[key]


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_a_file_comes_out_of_the_seed_again_byte_for_byte(group: str) -> None:
    generate = script("generate")
    text = generate.text_of(group, [generate.made(group, n) for n in range(generate.COUNT)])
    assert text == (FOLDER / "problems" / f"{group}.json").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_automatic_differentiation_finds_the_same_scores_and_matrices_at_the_impulses(group: str) -> None:
    for key in (key for key in IDS if key.startswith(group)):
        given, expected = problems()[key], problems()[key]["expected"]
        geometry, body, before, after, config = posed(given)
        frames = Frames.of(body, before, after, [given["dt"]])
        impulses = torch.tensor(expected["impulses"], dtype=torch.float64)[None]
        theta = Theta.of(geometry)
        at = theta.vector().requires_grad_()
        terms = loss_terms(contacts_of(theta.with_vector(at), frames), frames, impulses, config.weights)[0]
        assert terms.tolist() == pytest.approx(list(expected["terms"].values()), rel=1e-12, abs=1e-12 * expected["loss"])
        score = -0.5 * torch.autograd.grad(terms.sum(), at)[0].numpy()
        matrix = profile_fishers(geometry, frames, impulses.numpy(), config)[0]
        assert np.abs(score - expected["score"]).max() <= 1e-12 * np.abs(expected["score"]).max(), key
        right = whole(expected["gauss_newton"])
        assert np.abs(matrix - right).max() <= 2e-10 * np.abs(right).max(), key


@pytest.mark.parametrize("group", GROUPS)
def test_clarabel_finds_no_lower_objective(group: str) -> None:
    for key in (key for key in IDS if key.startswith(group)):
        given, expected = problems()[key], problems()[key]["expected"]
        geometry, body, before, after, config = posed(given)
        frames = Frames.of(body, before, after, [given["dt"]])
        posed_problem = cone_problems(contacts_of(Theta.of(geometry), frames), frames, config)
        found = objectives(posed_problem, clarabel_impulses(posed_problem)).values[0]
        assert found == pytest.approx(expected["objective"], abs=3e-8), key


def test_an_interior_point_method_at_its_default_tolerance_agrees_as_far_as_readme_says() -> None:
    check, answers = script("check"), {}
    for key, given in problems().items():
        geometry, body, before, after, config = posed(given)
        frames = Frames.of(body, before, after, [given["dt"]])
        posed_problem = cone_problems(contacts_of(Theta.of(geometry), frames), frames, config)
        impulses = clarabel_impulses(posed_problem, 1e-8)
        answers[key] = {"impulses": impulses[0].tolist(), "objective": float(objectives(posed_problem, impulses).values[0])}
    errors = check.compare(problems(), answers)
    digits = {
        name: [sum(error <= 10.0**-n for error in errors[name].values()) for n in (6, 3)] for name in answers["sliding-00"]
    }
    assert digits["objective"][0] > 200
    assert digits["objective"][1] == 220
    assert digits["impulses"][0] > 140
    assert digits["impulses"][1] > 215


def test_the_score_is_half_the_slope_of_the_minimal_objective() -> None:
    """The envelope theorem, with impulses that are solved again; in decimals, so that nothing is left to rounding."""
    reference = script("reference")
    given = problems()["sliding-06"]
    problem, step = reference.problem_of(given), reference.Decimal("1e-12")
    minima = []
    for side in (1, -1):
        flat = problem.theta.vector()
        moved = reference.Theta.of_vector([x + side * step * (k % 5 - 2) for k, x in enumerate(flat)])
        shifted = replace(problem, theta=moved)
        impulses = [x for impulse in reference.answer(shifted).impulses for x in impulse]
        with reference.localcontext() as context:
            context.prec = reference.DIGITS
            loss = sum(reference.terms_of(shifted, reference.threes(impulses)).values())
            minima.append(loss + shifted.weights["regularization"] * reference.dot(impulses, impulses))
    slope = float((minima[0] - minima[1]) / (2 * step))
    along = sum((k % 5 - 2) * g for k, g in enumerate(given["expected"]["score"]))
    assert slope == pytest.approx(-2.0 * along, rel=1e-9)


def test_the_answers_of_the_compiled_kernel_agree() -> None:
    check, answer = script("check"), script("runners/run_contact_curation").answer
    errors = check.compare(problems(), {key: answer(one) for key, one in problems().items()})
    assert all(len(each) == 220 for each in errors.values())
    for name in ("gaps", "next_gaps", "normal_jacobians", "tangent_jacobians", "free_velocity", "slips"):
        assert max(errors[name].values()) < 1e-12, name
    for name in ("loss", "objective"):
        assert max(errors[name].values()) < 1e-10, name
    for name in ("terms", "impulses", "score", "gauss_newton"):  # those that feel the last digits of impulses (section 6)
        assert max(errors[name].values()) < 1e-5, name
        assert sum(error < 1e-10 for error in errors[name].values()) > 100, name


WRONG: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "the quaternion's scalar last": lambda one: _with(one, "quaternion", lambda q: [*q[1:], q[0]]),
    "the quaternion of the other direction": lambda one: _with(one, "quaternion", lambda q: [q[0], *(-x for x in q[1:])]),
    "gravity in metres": lambda one: {**one, "gravity": 9.81},
    "tangents without friction": lambda one: {**one, "theta": {**one["theta"], "tangents": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]}},
    "contacts in another order": lambda one: {
        **one, "theta": {**one["theta"], "vertices_normal": one["theta"]["vertices_normal"][::-1]},
    },
    "no regularisation": lambda one: {**one, "weights": {**one["weights"], "regularization": 1e-9}},
    "the other cone": lambda one: {
        **one, "cone": {"kind": "circular"} if "facets" in one["cone"] else {"kind": "polyhedral", "facets": 8}
    },
}  # fmt: skip


def _with(one: dict[str, Any], name: str, change: Any) -> dict[str, Any]:
    return {**one, **{when: {**one[when], name: change(one[when][name])} for when in ("before", "after")}}


@pytest.mark.parametrize("mistake", WRONG)
def test_an_implementation_with_another_convention_is_told(mistake: str) -> None:
    check, answer = script("check"), script("runners/run_contact_curation").answer
    some = {key: one for key, one in problems().items() if key.startswith(("sliding", "coincident"))}
    answers = {key: found for key, one in some.items() if (found := answer(WRONG[mistake](one)))}
    errors = check.compare(problems(), {key: {"impulses": one["impulses"]} for key, one in answers.items()})
    assert sum(error > 1e-6 for error in errors["impulses"].values()) > 0.3 * len(answers)


ASSUMED: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "the time step of most problems": lambda one: {**one, "dt": problems()["sliding-00"]["dt"]},
    "the gravity of most problems": lambda one: {**one, "gravity": problems()["sliding-00"]["gravity"]},
    "a height in lengths though the normal is longer": lambda one: {
        **one, "theta": {**one["theta"], "height": one["theta"]["height"] * float(np.linalg.norm(one["theta"]["normal"]))},
    },
}  # fmt: skip


@pytest.mark.parametrize("mistake", ASSUMED)
def test_an_implementation_that_assumes_a_number_is_told_by_the_general_problems(mistake: str) -> None:
    check, answer = script("check"), script("runners/run_contact_curation").answer
    some = {key: one for key, one in problems().items() if key.startswith("general")}
    answers = {key: {"loss": answer(ASSUMED[mistake](one))["loss"]} for key, one in some.items()}
    errors = check.compare(problems(), answers)["loss"]
    assert len(errors) == 20
    assert min(errors.values()) > 1e-6


@pytest.mark.parametrize("name", ["match", "complementarity_normal", "complementarity_tangent", "dissipation", "penetration"])
def test_the_reference_answers_a_problem_without_one_of_the_terms(name: str) -> None:
    reference, given = script("reference"), problems()["general-06"]
    found = reference.expected(reference.problem_of({**given, "weights": {**given["weights"], name: 0.0}}))
    assert found["terms"][name] == 0.0
    assert found["certificate"]["gap"] == 0.0


def test_torch_s_solver_finds_the_impulses_too() -> None:
    for key in itertools.islice((key for key in IDS if key.startswith("sliding")), 6):
        geometry, body, before, after, config = posed(problems()[key])
        found = evaluate_in_torch(geometry, body, before, after, problems()[key]["dt"], config)
        assert np.abs(found.impulses[0] - problems()[key]["expected"]["impulses"]).max() < 1e-4


def test_the_schema_names_what_the_files_hold() -> None:
    schema = json.loads((FOLDER / "schema" / "problems.schema.json").read_text(encoding="utf-8"))
    problem = schema["$defs"]["problem"]
    for one in problems().values():
        assert set(one) == set(problem["required"]) == set(problem["properties"])
        assert set(one["expected"]) == set(problem["properties"]["expected"]["required"])
        assert set(one["theta"]) == set(problem["properties"]["theta"]["required"])
    answers = json.loads((FOLDER / "schema" / "answers.schema.json").read_text(encoding="utf-8"))
    assert set(answers["properties"]["answers"]["additionalProperties"]["properties"]) == set(script("check").QUANTITIES)
