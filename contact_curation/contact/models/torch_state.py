"""PyTorch in the state that computations here need, and afterwards as its user had it."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any


class _OfThisThread(threading.local):
    inside = False


_here, _lock = _OfThisThread(), threading.Lock()
_before = list[tuple[int, Any]]()
"""For each call under way the number of threads and the default type that the process had before the first of them."""


@contextmanager
def own_torch() -> Iterator[None]:
    """One thread, gradients, float32 and the CPU by default, whatever the caller has set. Does nothing without torch.

    Threads that share busy cores wait for each other, and sums would depend on their number. That number and the default type
    belong to the process: of calls that overlap in several threads the first one notes them, and the last one restores them.
    """
    if "torch" not in sys.modules or _here.inside:
        yield
        return
    import torch  # waits for a thread that is importing it

    with _lock:
        now = torch.get_num_threads(), torch.get_default_dtype()  # unasked, a new thread would take the process's number later
        _before.append(_before[0] if _before else now)
        torch.set_num_threads(1)
        torch.set_default_dtype(torch.float32)
        _here.inside = True
    try:
        on_cpu = nullcontext() if torch.get_default_device().type == "cpu" else torch.device("cpu")
        with torch.inference_mode(False), torch.enable_grad(), on_cpu:
            yield
    finally:
        with _lock:
            threads, kind = _before.pop()
            torch.set_num_threads(threads)
            if not _before:
                torch.set_default_dtype(kind)
            _here.inside = False
