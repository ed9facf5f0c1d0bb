"""Ends the process after some time, also while a library holds Python so that none of it runs."""

import ctypes

CLOCK_MONOTONIC, SIGEV_THREAD = 1, 2


class _Event(ctypes.Structure):
    """`struct sigevent` of Linux."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("rest", ctypes.c_char * 40),
    )


class _Times(ctypes.Structure):
    """`struct itimerspec`: the period, and the time until the first end."""

    _fields_ = (("period", ctypes.c_long * 2), ("first", ctypes.c_long * 2))


def exit_after(seconds: float, status: int) -> None:
    """Has the system call `_exit(status)` in a thread of its own after some time.

    Args:
        seconds: until then, more than 0.
        status: exit status.

    Raises:
        OSError: the system has no such timer.
    """
    system = ctypes.CDLL("librt.so.1", use_errno=True)  # where older C libraries have timers; newer ones have it, too
    event = _Event(status, 0, SIGEV_THREAD, ctypes.cast(system._exit, ctypes.c_void_p))
    whole, rest = divmod(seconds, 1.0)
    times = _Times((0, 0), (int(whole), int(1e9 * rest)))
    timer = ctypes.c_void_p()
    if system.timer_create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) or system.timer_settime(
        timer, 0, ctypes.byref(times), None
    ):
        raise OSError(ctypes.get_errno(), "no timer that ends the process")
