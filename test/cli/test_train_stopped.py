"""`train` that is stopped: it goes on to the same end, and takes no checkpoint for that of another training."""

import os
import shlex
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from contact_curation.cli.stop_signals import StopSignals
from contact_curation.learning.training.curated import CuratedTraining
from contact_curation.learning.training.progress import Progress
from test.cli.commands import Cli
from test.cli.trainings import SHORT, events, numbers

Interrupt = Callable[[], None]


def stopped_at(monkeypatch: pytest.MonkeyPatch, step: int, interrupt: Interrupt) -> None:
    """Once `step` gradient steps are taken, something interrupts."""
    advance = CuratedTraining.advance

    def interrupted(self: CuratedTraining, steps: int) -> Progress:
        progress = advance(self, steps)
        if progress.gradient_steps == step:
            interrupt()
        return progress

    monkeypatch.setattr(CuratedTraining, "advance", interrupted)


def killed() -> None:
    raise KeyboardInterrupt  # as of a second Ctrl-C: nothing more is stored


def send(number: signal.Signals) -> Interrupt:
    return lambda: os.kill(os.getpid(), number)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("interrupt", "stored"),
    [(send(signal.SIGINT), 7), (send(signal.SIGTERM), 7), (killed, 6)],
    ids=["Ctrl-C", "SIGTERM", "killed"],
)
def test_a_training_that_is_stopped_goes_on_to_the_same_end(
    cli: Cli, folder: Path, tmp_path: Path, interrupt: Interrupt, stored: int
) -> None:
    options = (
        *SHORT,
        "--top",
        3,
        "--criterion",
        "trace",
        "--rerank-when-stale",
        "--set",
        "staleness.steps=5",
        "--checkpoint-every",
        0,
    )
    whole, parts = tmp_path / "whole.safetensors", tmp_path / "parts.safetensors"
    assert cli("train", folder, "--out", whole, *options).status == 0
    with pytest.MonkeyPatch.context() as monkeypatch:
        stopped_at(monkeypatch, 7, interrupt)
        stopped = cli("train", folder, "--out", parts, *options)
    assert (stopped.status, stopped.out) == (130, "")
    assert stopped.err_lines[-1] == "contact-curation: interrupted"
    assert (f"stopped after 7 gradient steps; {parts} holds them" in stopped.err) is (stored == 7)
    resumed = cli("train", folder, "--out", parts, *options, "--resume")
    assert resumed.status == 0
    assert resumed.err_lines[0] == f"going on after {stored} gradient steps of {parts}"
    assert numbers(parts) == numbers(whole)
    assert (tmp_path / "parts.jsonl").read_bytes() == (tmp_path / "whole.jsonl").read_bytes()
    assert len([one for one in events(tmp_path / "whole.jsonl") if one["event"] == "selection"]) > 1


@pytest.mark.parametrize("dashes", [[], ["--"]], ids=["plain", "inputs behind two dashes"])
def test_the_command_that_is_said_after_a_stop_goes_on(cli: Cli, folder: Path, tmp_path: Path, dashes: list[str]) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        stopped_at(monkeypatch, 3, send(signal.SIGINT))
        stopped = cli("train", "--out", tmp_path / "a b.safetensors", *SHORT, "--overwrite", *dashes, folder)
    assert stopped.err_lines[-2].startswith("  contact-curation train ")
    again = cli(*shlex.split(stopped.err_lines[-2])[1:])
    assert again.status == 0
    assert "going on after 3 gradient steps" in again.err


def test_metrics_that_were_lost_are_written_again_from_the_checkpoint(cli: Cli, folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.safetensors"
    cli("train", folder, "--out", out, *SHORT)
    before = (tmp_path / "a.jsonl").read_bytes()
    (tmp_path / "a.jsonl").unlink()
    done = cli("train", folder, "--out", out, *SHORT, "--resume")
    assert done.status == 0
    assert (tmp_path / "a.jsonl").read_bytes() == before


def test_metrics_beyond_the_checkpoint_are_cut_when_it_goes_on(cli: Cli, folder: Path, tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole.safetensors", tmp_path / "parts.safetensors"
    cli("train", folder, "--out", whole, *SHORT)
    for step, interrupt in ((6, send(signal.SIGINT)), (10, killed)):
        with pytest.MonkeyPatch.context() as monkeypatch:
            stopped_at(monkeypatch, step, interrupt)
            cli("train", folder, "--out", parts, *SHORT, "--resume")
    assert [one["gradient_steps"] for one in events(tmp_path / "parts.jsonl")] == [0, 4, 8]
    done = cli("train", folder, "--out", parts, *SHORT, "--resume")
    assert "going on after 6 gradient steps" in done.err
    assert (tmp_path / "parts.jsonl").read_bytes() == (tmp_path / "whole.jsonl").read_bytes()


def test_a_second_signal_does_not_wait() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    with StopSignals() as stop:
        os.kill(os.getpid(), signal.SIGTERM)
        assert stop.wanted
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


def test_a_checkpoint_is_neither_overwritten_nor_taken_for_another_training(cli: Cli, folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.safetensors"
    assert cli("train", folder, "--out", out, *SHORT).status == 0
    before = out.read_bytes()
    refused = {
        (): "--out: found a file at",
        ("--resume", "--seed", "1"): "seed of the training to go on with: found 1, expected 0",
        ("--resume", "--steps", "13"): "found training.steps=13, expected training.steps=12 as in",
        ("--resume", "--held-out", "6"): "tosses of the training to go on with: found 6 tosses",
        ("--resume", "--model", "deep"): "model of the training to go on with: found deep, expected polytope",
        ("--resume", "--top", "2"): "selection of the training to go on with:",
    }
    for options, line in refused.items():
        done = cli("train", folder, "--out", out, *SHORT, *options)
        assert (done.status, len(done.err_lines)) == (1, 1)
        assert line in done.err
    assert out.read_bytes() == before
    assert cli("train", folder, "--out", out, *SHORT, "--overwrite", "--seed", 1).status == 0
    assert out.read_bytes() != before


def test_with_nothing_to_go_on_with_it_starts_over(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *SHORT, "--resume")
    assert done.status == 0
    assert done.err_lines[0] == f"found no {tmp_path / 'a.safetensors'} to go on with: starting over"
