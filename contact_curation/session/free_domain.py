"""A ROS domain of one's own on this machine: two graphs that start at once never share one.

A domain is claimed by an abstract Unix socket, which the system frees with the process, however that ends. Graphs that claim
nothing, such as nodes that somebody started by hand, are seen by their ports: DDS gives those of domain d from 7400 + 250 d on
(DDSI-RTPS 2.5, section 9.6.2.3).
"""

import os
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from contact_curation.errors import InvalidValueError

LARGEST_DOMAIN = 101
"""Domains up to this one keep their ports below those that Linux gives out."""

LARGEST_OF_DDS = 232
"""Ports of larger domains would be above 65535."""

FIRST_PORT, PORTS_EACH = 7400, 250
PORTS_IN_USE = 34
"""Of the first dozen processes in a domain, and of its multicast."""

VARIABLE = "ROS_DOMAIN_ID"


@contextmanager
def graph_domain(own: Mapping[str, str]) -> Iterator[int | str]:
    """The domain of a graph as long as it runs: the user's, where it is set, or else a free one.

    The user may listen in a domain of their own, so whether others are heard there is not asked; but two graphs would take each
    other's poses, tosses and goals.

    Args:
        own: environment of this process.

    Raises:
        InvalidValueError: the user's is none, or another graph runs in it; or all of them are taken.
    """
    given = own.get(VARIABLE)
    if given is None:
        with free_domain() as domain:
            yield domain
        return
    given = given.strip()
    if given and not (given.isdecimal() and str(int(given)) == given and int(given) <= LARGEST_OF_DDS):  # 012 is octal to ROS
        expected = f"a whole number from 0 to {LARGEST_OF_DDS} without a 0 in front, or none set, for a free domain"
        raise InvalidValueError(VARIABLE, given, expected)
    claim = _bound(int(given or 0))
    if claim is None:
        running = f"{given or 0}, in which a session is running"
        raise InvalidValueError(VARIABLE, running, "a domain without a session, or none set, for a free domain")
    with claim:
        yield given


@contextmanager
def free_domain() -> Iterator[int]:
    """A domain that nobody else on this machine uses, and that no other process is given meanwhile.

    Raises:
        InvalidValueError: all of them are taken.
    """
    for place in range(LARGEST_DOMAIN):
        domain = (os.getpid() + place) % LARGEST_DOMAIN + 1  # processes that start together seldom want the same one
        claim = _claimed(domain)
        if claim is not None:
            with claim:
                yield domain
            return
    raise InvalidValueError("free ROS domains", "none", f"one from 1 to {LARGEST_DOMAIN} that no graph uses")


def _claimed(domain: int) -> socket.socket | None:
    """What holds the domain; None where somebody has it."""
    claim = _bound(domain)
    if claim is not None and _has_participants(domain):
        claim.close()
        return None
    return claim


def _bound(domain: int) -> socket.socket | None:
    """What holds the domain, whoever is heard there; None where another graph has it."""
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        claim.bind(f"\0contact-curation-domain-{domain}")
    except OSError:
        claim.close()
        return None
    return claim


def _has_participants(domain: int) -> bool:
    first = FIRST_PORT + PORTS_EACH * domain
    for port in range(first, first + PORTS_IN_USE):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                return True
    return False
