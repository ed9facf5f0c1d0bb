"""Recordings scheduled by Ray, on one machine or a cluster: the same work as in processes of this machine.

Each recording is a task on one processor, which reads, checks and scores it; the driver takes results as they arrive. As many
tasks wait as are running, so that no worker is idle and the driver's memory does not grow. Ray itself repeats nothing: a task
whose worker dies, e.g. because memory ran out, is repeated once by the driver, and then given up.
"""

import os
import re
import socket
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.pipeline.workers import Advance, Broken, Counted, Finished, counted_work
from contact_curation.version import __version__

ONE_PROCESSOR_EACH = 1 << 16
"""Number of jobs that share a machine. Ray decides how many run, so each computes with one thread."""

TRIES = 2

LONGEST_CONNECTING = 10.0
"""Longest wait for the machine of an address [s]; Ray waits for many minutes."""


@dataclass(frozen=True)
class RayEngine:
    """Workers of a Ray cluster.

    Attributes:
        address: address of the cluster, as for `ray.init`; empty for the one in RAY_ADDRESS, or else a cluster on this machine.
    """

    address: str = ""

    def __post_init__(self) -> None:
        import_module("ray")  # if it is missing, the error comes before anything is read

    @property
    def jobs(self) -> int:
        """The same as in `Engine`."""
        return ONE_PROCESSOR_EACH

    def as_done[Input, Result](
        self, work: Callable[[Input, Advance], Result], inputs: Sequence[Input], advance: Advance
    ) -> Iterator[tuple[int, Result | Broken]]:
        """The same as in `Engine`.

        Raises:
            InvalidValueError: there is no cluster at the address.
            ContactCurationError: its workers have another release.
        """
        import ray

        if not inputs:
            return
        self._connect(ray)
        task = ray.remote(max_retries=0, num_cpus=1)(_checked)
        shared = ray.put(work)
        most = 2 * max(1, int(ray.cluster_resources().get("CPU", 1)))
        coming, under_way = deque(range(len(inputs))), dict[Any, int]()
        tries, finished = Counter[int](), Finished(inputs, advance)
        try:
            while coming or under_way:
                while coming and len(under_way) < most:
                    place = coming.popleft()
                    tries[place] += 1
                    under_way[task.remote(__version__, shared, inputs[place])] = place
                (reference,), _ = ray.wait(list(under_way), num_returns=1)
                place = under_way.pop(reference)
                result, count = self._result(ray, reference)
                if isinstance(result, Broken) and tries[place] < TRIES:
                    coming.append(place)
                    continue
                finished.add(place, count)
                yield place, result
        finally:
            for reference in under_way:
                ray.cancel(reference, force=True)

    def _connect(self, ray: Any) -> None:
        if ray.is_initialized():
            return
        address = self.address or os.environ.get("RAY_ADDRESS", "")
        try:
            if named := re.fullmatch(r"(?:ray://)?\[?([^/]+?)\]?:(\d+)", address):
                socket.create_connection((named[1], int(named[2])), LONGEST_CONNECTING).close()
            # A metrics agent and a dashboard would be started on this machine, and print.
            ray.init(address=self.address or None, include_dashboard=None if self.address else False, log_to_driver=False)
        except Exception as error:  # Ray's own are of many kinds, some of none
            option = "--address" if self.address else "RAY_ADDRESS"
            raise InvalidValueError(option, f"{address} ({error})", "the address of a Ray cluster that runs") from error

    @staticmethod
    def _result(ray: Any, reference: Any) -> Counted[Any]:
        """The result of a task, or `Broken` if its worker died."""
        try:
            result: Counted[Any] = ray.get(reference)
        except ray.exceptions.RayTaskError as error:  # the work's own error
            if isinstance(error.cause, MemoryError):
                return Counted(Broken("asked for more memory than its worker has, twice: left out"), 0)
            raise error.cause from error
        except ray.exceptions.RayError as error:
            return Counted(Broken(f"its worker died twice ({type(error).__name__}): left out"), 0)
        return result


def _checked[Input, Result](release: str, work: Callable[[Input, Advance], Result], one: Input) -> Counted[Result]:
    """Does the work in a worker, if the worker has the driver's release. Ray sends this function with the driver's globals.

    Raises:
        ContactCurationError: another release is installed; or an error of the work, as one that can be pickled.
    """
    installed = import_module("contact_curation.version").__version__
    if release != installed:
        raise ContactCurationError(
            f"a worker of the cluster has contact_curation {installed}, expected {release} as on the driver"
        )
    try:
        return counted_work(work, one)
    except ContactCurationError as error:
        raise ContactCurationError(str(error)) from None
