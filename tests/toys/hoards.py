"""What holds memory of the kernel, and in its own nothing."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice

_AT_LEAST = 512 * 2**20  # bytes that a hoard would come to


def _full_pairs() -> Iterator[tuple[int, socket.socket, socket.socket]]:
    """Yield pairs of sockets, and the bytes that one has sent to the other."""
    while True:
        one, other = socket.socketpair()
        one.setblocking(False)
        one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2**24)
        held = 0
        with suppress(BlockingIOError):
            while True:
                held += one.send(bytes(2**16))
        yield held, one, other


def in_sockets(seconds: float, still: int = _AT_LEAST) -> bytes:
    """Hold it in sockets, those of several processes where one may not have so many open."""
    kept = []
    with suppress(OSError):
        for sent, *pair in _full_pairs():
            kept.append(pair)
            still -= sent
            if still <= 0:
                break
    if still > 0 and os.fork() == 0:
        kept.clear()
        in_sockets(seconds, still)
        os._exit(0)
    time.sleep(seconds)
    return b"held"


def in_waiting_sockets(seconds: float) -> bytes:
    """Hold it in sockets that nothing has open: they wait in another."""
    here, _there = socket.socketpair()
    for _, *pair in islice(_full_pairs(), 200):
        socket.send_fds(here, [b"x"], [one.fileno() for one in pair])
        for one in pair:
            one.close()
    time.sleep(seconds)
    return b"held"


def in_none(seconds: float) -> bytes:
    """Use sockets of every kind as good strategies might."""
    kept = [one for _ in range(100) for one in socket.socketpair()]
    kept.append(socket.create_server(("127.0.0.1", 0)))
    for _ in range(10):
        kept.append(socket.create_connection(kept[200].getsockname()))
        kept.append(kept[200].accept()[0])
    time.sleep(seconds)
    return b"held"
