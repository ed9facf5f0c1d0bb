"""Compares answers with the expected ones.

    python check.py ANSWERS.json [--digits N] [--certify] [--problems FOLDER]

Needs the standard library alone, and `reference.py` beside it for --certify. Prints how many problems agree to 10, 6 and 3
digits, quantity by quantity, where the largest error is, and the number to look at first. Exit status 0 if everything that was
answered agrees to N digits (6 unless given), else 1; 2 if a file cannot be read. README.md describes the form of ANSWERS.json
and what the digits mean.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any, Iterator, Optional

DIGITS = (10, 6, 3)
QUANTITIES = (
    "gaps", "next_gaps", "normal_jacobians", "tangent_jacobians", "free_velocity", "slips",
    "impulses", "terms", "loss", "objective", "score", "gauss_newton",
)  # fmt: skip


class UnreadableAnswersError(Exception):
    """A file of answers or problems has another form."""


def numbers(value: Any, like: Any, place: str) -> Iterator[tuple[str, Optional[float], float]]:
    """(place, given, expected) of each number; None where null was given. Of a full matrix the lower triangle counts."""
    if isinstance(like, dict):
        if not isinstance(value, dict) or set(value) - set(like):
            raise UnreadableAnswersError(f"{place}: found {_shown(value)}, expected the keys {', '.join(like)}")
        for key, expected in like.items():
            yield from numbers(value.get(key), expected, f"{place}.{key}")
    elif value is None:
        for expected in flat(like):
            yield place, None, expected
    elif isinstance(like, list):
        triangle = place.endswith(".gauss_newton")
        if not isinstance(value, list) or len(value) != len(like):
            raise UnreadableAnswersError(f"{place}: found {_shown(value)}, expected {len(like)} entries")
        for k, (each, expected) in enumerate(zip(value, like)):
            row = each[: k + 1] if triangle and isinstance(each, list) and len(each) == len(like) else each
            yield from numbers(row, expected, f"{place}[{k}]")
    elif isinstance(value, bool) or not isinstance(value, (int, float)):
        raise UnreadableAnswersError(f"{place}: found {_shown(value)}, expected a number")
    else:
        yield place, float(value), float(like)


def difference(given: Optional[float], expected: float) -> float:
    """Infinite where there is no number."""
    return abs(given - expected) if given is not None and math.isfinite(given) else math.inf


def flat(value: Any) -> Iterator[float]:
    """All numbers of nested lists and mappings."""
    if isinstance(value, (list, dict)):
        for each in value.values() if isinstance(value, dict) else value:
            yield from flat(each)
    else:
        yield float(value)


def error_of(name: str, given: Any, expected: dict[str, Any], place: str) -> Optional[float]:
    """Largest difference as a share of the largest expected number; of the terms, of the loss. None if nothing was given."""
    found = [difference(a, b) for _, a, b in numbers(given, expected[name], f"{place}.{name}") if a is not None]
    if not found:
        return None
    scale = abs(expected["loss"]) if name == "terms" else max(abs(number) for number in flat(expected[name]))
    return max(found) / (scale or 1.0)


def problems_of(folder: Path) -> dict[str, dict[str, Any]]:
    """All problems of a folder by their id."""
    files = sorted(folder.glob("*.json"))
    if not files:
        raise UnreadableAnswersError(f"{folder}: found no problems")
    return {one["id"]: one for file in files for one in content_of(file, "contact-loss-problems")["problems"]}


def content_of(path: Path, form: str) -> dict[str, Any]:
    """A file of the given format."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"), parse_int=float)
    except (OSError, ValueError) as error:
        raise UnreadableAnswersError(f"{path}: {error}") from error
    if not isinstance(content, dict) or content.get("format") != form or content.get("version") != 1:
        raise UnreadableAnswersError(f'{path}: expected "format": "{form}" and "version": 1')
    return content


def answers_of(path: Path) -> tuple[str, dict[str, dict[str, Any]]]:
    """Name of the implementation and its answers by id."""
    content = content_of(path, "contact-loss-answers")
    answers = content.get("answers")
    if not isinstance(answers, dict) or not all(isinstance(each, dict) for each in answers.values()):
        raise UnreadableAnswersError(f'{path}: expected "answers": a mapping from ids of problems to quantities')
    return str(content.get("implementation", "unnamed")), answers


def compare(problems: dict[str, dict[str, Any]], answers: dict[str, dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Errors by quantity and id, of what was answered."""
    found: dict[str, dict[str, float]] = {name: {} for name in QUANTITIES}
    for key, answer in answers.items():
        if key not in problems:
            raise UnreadableAnswersError(f"{key}: no such problem")
        for name in answer:
            if name not in QUANTITIES:
                raise UnreadableAnswersError(f"{key}: unknown quantity {name!r}, expected some of {', '.join(QUANTITIES)}")
            error = error_of(name, answer[name], problems[key]["expected"], key)
            if error is not None:
                found[name][key] = error
    return found


def table(errors: dict[str, dict[str, float]]) -> str:
    """The report, one line a quantity."""
    lines = [f"{'quantity':18}{'answered':>9}" + "".join(f"{f'{n} digits':>11}" for n in DIGITS) + "   largest error"]
    for name, each in errors.items():
        if not each:
            lines.append(f"{name:18}{0:9}")
            continue
        counts = "".join(f"{sum(error <= 10.0**-n for error in each.values()):11}" for n in DIGITS)
        worst = max(each, key=lambda key: each[key])
        lines.append(f"{name:18}{len(each):9}{counts}   {each[worst]:.1e} in {worst}")
    return "\n".join(lines)


def first_difference(
    problems: dict[str, dict[str, Any]], answers: dict[str, dict[str, Any]], errors: dict[str, dict[str, float]], allowed: float
) -> str:
    """The largest error of the first quantity that does not agree; what follows in the table depends on it."""
    for name, each in errors.items():
        key = max(each, key=lambda key: each[key], default="")
        if key and each[key] > allowed:
            given = numbers(answers[key][name], problems[key]["expected"][name], f"{key}.{name}")
            place, found, expected = max((one for one in given if one[1] is not None), key=lambda one: difference(*one[1:]))
            return f"look first at {place}: found {found}, expected {expected}"
    return ""


def certificates(problems: dict[str, dict[str, Any]], answers: dict[str, dict[str, Any]]) -> str:
    """What the impulses prove themselves, without the expected ones: section 7 of CONVENTIONS.md."""
    sys.path.insert(0, str(Path(__file__).resolve().parent))
    import reference  # here: whoever has problems and checker alone can still compare

    worst: dict[str, tuple[float, str]] = {}
    incomplete = []
    for key, answer in answers.items():
        if answer.get("impulses") is None:
            continue
        given = [found for _, found, _ in numbers(answer["impulses"], problems[key]["expected"]["impulses"], key)]
        if any(found is None or not math.isfinite(found) for found in given):
            incomplete.append(key)
            continue
        for name, value in reference.certificate(reference.problem_of(problems[key]), answer["impulses"]).items():
            worst[name] = max(worst.get(name, (0.0, key)), (value, key))
    lines = [f"{name}: at most {value:.1e}, in {key}" for name, (value, key) in worst.items()]
    if incomplete:
        lines.append(f"not certified, as impulses are missing or not finite: {', '.join(incomplete)}")
    return "\n".join(lines)


def main() -> int:
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("answers", type=Path)
    parser.add_argument("--digits", type=int, default=6, help="exit status 0 only if all answers agree to so many digits")
    parser.add_argument("--certify", action="store_true", help="also check the impulses by their own certificate")
    parser.add_argument("--problems", type=Path, default=Path(__file__).resolve().parent / "problems")
    options = parser.parse_args()
    try:
        problems = problems_of(options.problems)
        name, answers = answers_of(options.answers)
        errors = compare(problems, answers)
        proof = certificates(problems, answers) if options.certify else ""
    except UnreadableAnswersError as error:
        print(error, file=sys.stderr)
        return 2
    answered = {key for each in errors.values() for key in each}
    print(f"{name}: {len(answered)} of {len(problems)} problems answered")
    print(table(errors))
    if proof:
        print(proof)
    allowed = 10.0**-options.digits
    wrong = sorted({key for each in errors.values() for key, error in each.items() if error > allowed})
    if wrong or not answered:
        if wrong:
            print(first_difference(problems, answers, errors, allowed))
        print(f"not to {options.digits} digits: {', '.join(wrong) or 'nothing was answered'}")
        return 1
    print(f"all that was answered agrees to {options.digits} digits")
    return 0


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) < 60 else text[:57] + "..."


if __name__ == "__main__":
    sys.exit(main())
