"""The entry point of the command line: finds the verb, runs it, and turns errors into one line and an exit status.

0 done, 1 an error, 2 bad usage, 130 interrupted by Ctrl-C or SIGTERM.
"""

import argparse
import gc
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Any, TextIO, cast

from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.report import warn
from contact_curation.cli.stop_signals import endings_as_interrupt
from contact_curation.errors import CONTROLS, ContactCurationError, InvalidValueError, NothingFoundError
from contact_curation.extras import says_what_to_install
from contact_curation.version import __version__

NAME = "contact-curation"
INTERRUPTED = 130
VERBS = {
    "check": ("cli.check", "what is wrong with recordings, and what to do; use it first"),
    "import": ("cli.import_data", "public data as the bag that a rig would have recorded of it"),
    "rank": ("cli.rank.command", "a ranked manifest of the tosses in recordings; nothing is deleted"),
    "body": ("cli.body", "what was understood of an object: YAML, URDF, MJCF or a mesh"),
    "rig": ("cli.rig", "rig calibration from tosses: the board's tilt and height, and the tracker's length scale"),
    "score": ("cli.score", "loss terms, impulses and scores of every transition, as an .npz file"),
    "train": ("cli.train.command", "a model that learns from tosses, as a checkpoint"),
    "evaluate": (
        "cli.evaluate",
        "prediction errors of a model on measured tosses, and its uncertainty",
    ),
    "design": ("cli.design", "the throws with the largest predicted information gain"),
    "simulate": ("cli.simulate", "throws made in the simulated world, as the bag that a rig would have recorded"),
    "reproduce": ("experiments.reproduce", "an experiment over many trainings: tables and figures"),
    "online": ("cli.online.command", "the whole graph, closed to a loop: design, throw, track, score, curate, train"),
    "export": ("cli.export", "the tosses that a ranking selected, as MCAP, ContactNets' files or a LeRobot dataset"),
    "play": ("cli.play", "a bag as live topics"),
}
"""Verbs by their names: the module, which has `add_options` and `run`, and what the verb does."""


def build_parser(words: Sequence[str]) -> OneLineParser:
    """The parser of a command line; only the verbs among its `words` are imported, so that --help is fast."""
    parser = OneLineParser(
        prog=NAME,
        description="Computes each toss's information about an object's shape and friction, and selects the best set.",
        epilog="Exit status: 0 done, 1 a one-line error, 2 bad usage, 130 interrupted. VERB --help lists a verb's options.",
    )
    parser.add_argument("--version", action="version", version=f"{NAME} {__version__}")
    verbs = parser.add_subparsers(title="verbs", metavar="VERB", required=True)
    for verb, (module, purpose) in VERBS.items():
        own = verbs.add_parser(verb, help=purpose)
        if verb in words:
            import_module(f"contact_curation.{module}").add_options(own)
    parser.add_letters()
    return parser


def _complete(parser: argparse.ArgumentParser) -> None:
    """Prints completions if the shell asks for them (docs/commands.md), and ends the process; otherwise does nothing."""
    if "_ARGCOMPLETE" in os.environ:
        import argcomplete

        argcomplete.autocomplete(parser)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line; returns its exit status."""
    # With thousands of small matrices BLAS threads mostly wait for each other; on a busy machine that takes five times longer.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if argv is None:  # a process of its own
        gc.disable()  # until everything is imported
        os.environ["MPLBACKEND"] = "agg"  # figures become files; a notebook's shell names a backend that may not be here
    _prepare_streams()
    try:
        with redirect_stdout(cast(TextIO, _Visible(sys.stdout))), redirect_stderr(cast(TextIO, _Visible(sys.stderr))):
            status = _status(sys.argv[1:] if argv is None else list(argv))
    except KeyboardInterrupt:  # another one, after the first had ended the work
        status = INTERRUPTED
    if argv is None and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # another Ctrl-C while the interpreter ends gives no traceback
    return status


class _Visible:
    """A stream of text that shows control characters in place of writing them."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        return self._stream.write(text.translate(CONTROLS))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _status(words: list[str]) -> int:
    try:
        with endings_as_interrupt():
            return _run(words)
    except ContactCurationError as error:
        if isinstance(error, NothingFoundError):
            warn(error.warnings)
        return _failed(str(error))
    except KeyboardInterrupt:
        print(f"{NAME}: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        _forget_output()
        return 1
    except OSError as error:  # a full disk, a quota, too many open files
        _forget_output()
        where = error.filename or "standard output or a temporary file"
        return _failed(f"{where}: found {error.strerror or error}, expected to read and write there")
    except MemoryError as error:
        return _failed(f"memory: found too little ({error}), expected more; fewer --jobs or inputs at once need less")


@says_what_to_install
def _run(words: list[str]) -> int:
    parser = build_parser(words or os.environ.get("COMP_LINE", "").split())
    if not gc.isenabled():
        gc.freeze()  # what was imported stays: the garbage collector need not look through it
        gc.enable()
    _complete(parser)
    arguments = parser.parse_args(words)
    arguments.command = (NAME, *words)
    _check_folder()
    try:
        status: int = arguments.run(arguments)
    except NothingFoundError as error:
        raise NothingFoundError("; ".join(filter(None, (str(error), _assumed(arguments)))), error.warnings) from error
    sys.stdout.flush()
    if _assumed(arguments):
        print(f"{NAME}: {_assumed(arguments)}", file=sys.stderr, flush=True)
    return status


def _check_folder() -> None:
    """Refuses a working folder that is gone: libraries that are loaded there end the process at once.

    Raises:
        InvalidValueError: it was deleted.
    """
    try:
        Path.cwd()
    except FileNotFoundError as error:
        raise InvalidValueError("working folder", "one that was deleted", "one that is there: cd to it") from error


def _assumed(arguments: argparse.Namespace) -> str:
    """Assumptions of a verb that the user should know, such as the body; empty if there are none."""
    return getattr(arguments, "assumed", "")


def _failed(why: str) -> int:
    print(f"{NAME}: error: {' '.join(why.split())}", file=sys.stderr)
    return 1


def _forget_output() -> None:
    """Discards further output because its reader has closed the pipe; otherwise the interpreter reports it again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _prepare_streams() -> None:
    """Replaces streams that the shell closed (`>&-`), and lets a terminal show unsupported characters as escapes.

    All three, in their order: else an output would get the number of one, and what libraries print there would be in it.
    """
    sys.stdin = sys.stdin or Path(os.devnull).open(encoding="utf-8")  # noqa: SIM115 - open until the process ends
    sys.stdout = sys.stdout or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    sys.exit(main())
