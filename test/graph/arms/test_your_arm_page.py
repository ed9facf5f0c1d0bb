"""docs/how-to/your_arm.md, followed word for word on the foreign arm: every block is run, every line of `check` is provoked.

Nodes are told besides that time is simulated, and to be patient with a busy machine.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields

import pytest
import yaml
from contact_curation_msgs.msg import ThrowReport

from contact_curation.nodes.ros.qos import RESULTS_DEPTH
from contact_curation.simulation.arm.described import DescribedArmConfig
from test.conftest import REPOSITORY
from test.foreign_arm.arms import FILES
from test.graph.parts.declared_parameters import all_declared
from test.graph.parts.described_arm import PATIENT, SLOWED
from test.graph.parts.graph import Graph, within
from test.graph.parts.thrower import Thrower

PAGE = (REPOSITORY / "docs" / "how-to" / "your_arm.md").read_text()
BLOCKS = re.findall(r"^```([^\n]*)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
COMMANDS = re.compile(r"^ros2 (?:.*\\\n)?(?:[^\n]*\n)+?(?=ros2 |\Z)", re.MULTILINE)
BENCHMARKS = ["python -m benchmarks.design.trajectory_throws"]
"""What the page shows, indented, of how its table was made."""

LONG = 120.0
FAULTS = ("slider", "silent", "offset", "inactive", "unseen")


def table(heading: str) -> list[str]:
    """First cells of the table with this heading."""
    rows = PAGE[PAGE.index(f"| {heading} |") :].partition("\n\n")[0].splitlines()[2:]
    return [row.split("|")[1].strip() for row in rows]


def test_the_first_table_has_every_key_of_the_arm_s_file_and_the_file_of_the_page_is_that_of_the_tests() -> None:
    assert [key.strip("`") for key in table("key")] == [each.name for each in fields(DescribedArmConfig)]
    assert yaml.safe_load(BLOCKS[0][1]) == yaml.safe_load(FILES["ur5e"].read_text())


def test_parameters_that_the_page_names_are_the_node_s() -> None:
    declared = {one.name for one in all_declared()["trajectory_thrower"]}
    start = PAGE.index("| what you have |")
    cells = [row.split("|")[2] for row in PAGE[start:].partition("\n\n")[0].splitlines()[2:]]
    named = {name for cell in cells for name in re.findall(r"`([a-z_.]+)(?::=\w+)?`", cell)}
    assert len(named) > 10
    assert named <= declared


def test_the_page_shows_no_command_beside_its_blocks_but_benchmarks() -> None:
    assert (
        re.findall(r"^    (\S.*)$", re.sub(r"^```.*?^```$", "", PAGE, flags=re.MULTILINE | re.DOTALL), re.MULTILINE)
        == BENCHMARKS
    )


class Reader:
    """Somebody who follows the page in a shell.

    Args:
        graph: that he works in; the page's files are in its folder.
    """

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.running: list[subprocess.Popen[bytes]] = []
        self.said: set[str] = set()
        folder = graph.folder / "bin"
        folder.mkdir()
        command = folder / "ros2"
        command.write_text(f'#!/bin/sh\nexec {sys.executable} -m test.graph.parts.ros2_command "$@"\n')
        command.chmod(0o755)
        settings = {"/**": {"ros__parameters": {"use_sim_time": True}}, "/**/trajectory_thrower": {"ros__parameters": PATIENT}}
        told = graph.folder / "more.yaml"
        told.write_text(yaml.safe_dump(settings))
        self._environment = {
            **os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "PYTHONPATH": str(REPOSITORY),
            "ROS_DOMAIN_ID": str(graph.domain), "ROS2_RUN_MORE": f"--ros-args --params-file {told}",
        }  # fmt: skip

    def types(self, command: str) -> subprocess.Popen[bytes]:
        """A command in a terminal of its own."""
        name = f"{len(self.running)}_{'_'.join(command.split()[1:4]).replace('/', '_')}.log"
        with (self.graph.folder / name).open("wb") as log:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {command}"], cwd=self.graph.folder, env=self._environment, stdout=log, stderr=log
            )
        self.running.append(process)
        return process

    def runs(self, command: str) -> str:
        """A command that ends, and what it prints."""
        done = subprocess.run(
            ["bash", "-c", command], cwd=self.graph.folder, env=self._environment, capture_output=True, text=True, check=False,
            timeout=LONG,
        )  # fmt: skip
        assert done.returncode == 0, f"{command}\n{done.stderr}\n{self.graph.logs()}"
        return done.stdout

    def leaves(self, *processes: subprocess.Popen[bytes]) -> None:
        """Ctrl-C."""
        for process in processes:
            process.send_signal(2)
        for process in processes:
            assert process.wait(LONG) == 0


@pytest.fixture
def reader(graph: Graph) -> Iterator[Reader]:
    made = Reader(graph)
    yield made
    for process in made.running:
        if process.poll() is None:
            process.kill()
            process.wait()


@pytest.mark.slow
@pytest.mark.live
def test_the_page_is_followed_word_for_word(graph: Graph, reader: Reader) -> None:
    blocks = iter(BLOCKS)
    thrower = Thrower(graph, "trajectory_thrower")

    def commands() -> list[str]:
        mark, text = next(blocks)
        assert mark == "sh ros2"
        found = COMMANDS.findall(text)
        assert "".join(found) == text
        return found

    def checked() -> str:
        answer = thrower.trigger("check")
        reader.said |= set(answer.splitlines())
        return answer

    def until_said(*lines: str) -> None:
        answer = ""

        def all_said() -> bool:
            nonlocal answer
            answer = checked()
            return all(re.search(line, answer, re.MULTILINE) for line in lines)

        assert within(all_said, LONG), f"waited for {lines}, {answer!r} was said\n{graph.logs()}"

    (kind, text), (node,) = next(blocks), commands()
    assert kind == "yaml"
    (graph.folder / "my_arm.yaml").write_text(text)
    (graph.folder / "ur5e.urdf").write_bytes((FILES["ur5e"].parent / "ur5e.urdf").read_bytes())
    own = reader.types(node)
    until_said("found no action", "found no service", "joint states: found none", "scaling: found none", "no pose")
    graph.start("test.graph.parts.foreign_controller", arm=graph.folder / "my_arm.yaml", rate=SLOWED)
    until_said("^nothing is missing; disarmed")
    for fault in FAULTS:
        thrower.set_parameters("foreign_controller", fault=fault)
        graph.until(lambda: not checked().startswith("nothing"), LONG, f"check to notice {fault}")
        thrower.set_parameters("foreign_controller", fault="")
        graph.until(lambda: checked().startswith("nothing"), LONG, f"the end of {fault}")
    until_said("^nothing is missing; disarmed")
    (check,) = commands()
    assert "nothing is missing" in reader.runs(check)

    arm, goal = commands()
    assert "armed" in reader.runs(arm)
    sent = reader.types(goal)
    until_said("busy with throw first")
    assert sent.wait(LONG) == 0
    assert "success=True" in graph.folder.joinpath("1_action_send_goal_--feedback.log").read_text(), graph.logs()

    reports = graph.listener.listen(ThrowReport, "/throw_report", RESULTS_DEPTH)
    others = [reader.types(command) for command in commands()]
    graph.until(
        lambda: any(report.state == "scored" for report in reports), 4.0 * LONG, "a throw of the designer that was scored"
    )
    reader.leaves(*others)
    assert "stopped" in thrower.trigger("stop")
    thrower.until_still(100)
    graph.until(lambda: "busy" not in checked(), LONG, "the end of the goal")

    arm, home = commands()
    assert "armed" in reader.runs(arm)
    assert "on its way home" in reader.runs(home)
    until_said("^nothing is missing; armed")
    assert next(blocks, None) is None
    reader.leaves(own)
    thrower.close()
    rows = [
        re.escape(part).replace(r"\.\.\.", ".*") for row in table("line begins with") for part in re.findall(r"`([^`]+)`", row)
    ]
    assert [row for row in rows if not any(re.match(row, line) for line in reader.said)] == []
