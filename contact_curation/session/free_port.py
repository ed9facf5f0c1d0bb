"""Ports of this machine that nobody listens on."""

import socket


def free_port(wanted: int) -> int:
    """The port that is wanted, or another one where that is taken; somebody else may still be faster."""
    for port in (wanted, 0):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    return wanted
