"""The commands of the documentation, copied from it and run: README.md, docs/tutorial.md and docs/how-to/install.md.

Commands stand in fenced blocks that begin with ```sh. A block marked `background` has a terminal of its own and runs until the
end; one marked `ros2` needs a full ROS 2, which the package index does not have.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.session.free_domain import free_domain
from contact_curation.storage.stores.information import InformationStore
from test.conftest import REPOSITORY

BLOCK = re.compile(r"^```(sh[^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

FROM_TERMINAL_TO_TERMINAL = 8
"""[s] that a person takes at least, and a node has to come up."""

RUN_ELSEWHERE = {
    "make demo": "test/cli/test_demo.py",
    "make test": "this is one of its tests",
    "make setup": "make test does so first",
    "sudo apt install": "system packages",
    "contact-curation check": "test/docs/test_commands.py",
    "pip install": "test/packaging/test_extras.py",
}
"""Beginnings of the blocks of README.md and of the install page, and what runs them or what they need."""
OUTPUT = re.compile(r"^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: str) -> list[tuple[str, str]]:
    """How each block of a page is marked, and its commands."""
    return [(mark.removeprefix("sh").strip(), text) for mark, text in BLOCK.findall((REPOSITORY / page).read_text())]


def script(page: str) -> str:
    """One script of all blocks, which ends what is left in the background."""
    lines = ["set -euo pipefail", "trap 'jobs -p | xargs -r kill -INT; wait' EXIT"]
    waiting = False
    for number, (mark, text) in enumerate(blocks(page)):
        if mark == "background":
            lines.append(f"({text.strip()}) > terminal_{number}.log 2>&1 &")
            waiting = True
        elif not mark:
            lines += [f"sleep {FROM_TERMINAL_TO_TERMINAL}"] if waiting else []
            lines.append(text)
            waiting = False
    return "\n".join(lines)


def test_every_block_is_marked_as_one_that_a_test_knows() -> None:
    assert {mark for mark, _ in blocks("docs/tutorial.md")} == {"", "background", "ros2"}


@pytest.mark.parametrize("text", [text for page in ("README.md", "docs/how-to/install.md") for _, text in blocks(page)])
def test_every_command_of_the_readme_is_run_by_some_test(text: str) -> None:
    place = next(found for beginning, found in RUN_ELSEWHERE.items() if text.startswith(beginning))
    assert not place.endswith(".py") or (REPOSITORY / place).is_file()


@pytest.mark.slow
def test_the_five_lines_of_the_readme_print_what_it_shows(tmp_path: Path) -> None:
    (tmp_path / "bags").symlink_to(REPOSITORY / "bags")
    (commands,) = (text for _, text in blocks("README.md") if text.startswith("contact-curation"))
    assert len(commands.splitlines()) == 5
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-e", "-c", commands], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (shown,) = OUTPUT.findall((REPOSITORY / "README.md").read_text())
    printed = {line.rstrip() for line in done.stdout.splitlines()}
    assert [line for line in shown.splitlines() if line not in printed] == []


@pytest.mark.slow
def test_check_prints_what_the_tutorial_shows(tmp_path: Path) -> None:
    texts = [text for _, text in blocks("docs/tutorial.md")]
    last = next(place for place, text in enumerate(texts) if text.startswith("contact-curation check "))
    paths = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    commands = "\n".join(["set -e", *texts[:last], f'PATH="{paths}"', texts[last]])
    done = subprocess.run(
        ["bash", "-c", commands], cwd=REPOSITORY, env={**os.environ, "HOME": str(tmp_path), "PATH": paths},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (shown,) = OUTPUT.findall((REPOSITORY / "docs" / "tutorial.md").read_text())
    assert " ".join(shown.split()) in " ".join(done.stdout.split())


@pytest.mark.slow
@pytest.mark.live
def test_the_tutorials_commands_run_as_they_are_written(tmp_path: Path) -> None:
    environment = {**os.environ, "HOME": str(tmp_path), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
    with free_domain() as domain:
        done = subprocess.run(
            ["bash", "-c", script("docs/tutorial.md")], cwd=REPOSITORY, env={**environment, "ROS_DOMAIN_ID": str(domain)},
            capture_output=True, text=True, timeout=600, check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    made = tmp_path / "brick"
    for name in ("manifest.csv", "manifest_2.csv", "motion.png", "brick.safetensors", "next.json"):
        assert (made / name).is_file(), name
    with InformationStore(made / "buffer.sqlite") as store:
        assert len(json.loads(store.states.load("buffer") or b"{}")["selected"]) == 8
