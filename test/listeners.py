"""Where processes of this machine can be reached, as Linux says it."""

import socket
import struct
from collections.abc import Iterable, Iterator
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path
from typing import NamedTuple

LISTENS, UNCONNECTED = "0A", "07"
"""States of TCP and of UDP sockets that anybody may send to (include/net/tcp_states.h)."""


class Listener(NamedTuple):
    """A socket that is open for others.

    Attributes:
        protocol: tcp or udp, 6 behind it for IPv6.
        address: that it is bound to.
        port: that it is bound to.
    """

    protocol: str
    address: IPv4Address | IPv6Address
    port: int


def listeners_of(processes: Iterable[int]) -> set[Listener]:
    """Open TCP and UDP sockets of processes and of all that they started."""
    inodes = {inode for process in processes for one in family(process) for inode in _sockets(one)}
    return {one for inode, one in _bound() if inode in inodes}


def beyond_loopback(found: Iterable[Listener]) -> list[Listener]:
    """Those that are not on a loopback address; multicast that is taken on such an interface only comes from this machine."""
    return sorted(one for one in found if not one.address.is_loopback)


def family(process: int) -> list[int]:
    """A process and its descendants."""
    children = Path(f"/proc/{process}/task").glob("*/children")
    found = [int(child) for path in children for child in path.read_text().split()]
    return [process, *(one for child in found for one in family(child))]


def _sockets(process: int) -> Iterator[str]:
    for descriptor in Path(f"/proc/{process}/fd").iterdir():
        try:
            target = str(descriptor.readlink())
        except FileNotFoundError:  # closed meanwhile
            continue
        if target.startswith("socket:["):
            yield target[len("socket:[") : -1]


def _bound() -> Iterator[tuple[str, Listener]]:
    for protocol in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path("/proc/net", protocol).read_text().splitlines()[1:]:
            words = line.split()
            address, _, port = words[1].partition(":")
            if words[3] == (LISTENS if protocol.startswith("tcp") else UNCONNECTED):
                yield words[9], Listener(protocol, _address(address), int(port, 16))


def _address(text: str) -> IPv4Address | IPv6Address:
    """An address as /proc/net writes it: words of 32 bits in the machine's order."""
    words = [int(text[start : start + 8], 16) for start in range(0, len(text), 8)]
    packed = b"".join(struct.pack("=I", word) for word in words)
    return ip_address(socket.inet_ntop(socket.AF_INET if len(words) == 1 else socket.AF_INET6, packed))
