"""Ports for processes that tests start: what listens there begins some seconds later."""

import contextlib
import itertools
import os
import socket

_SHARE = 1000
_FIRST = 20_000 + _SHARE * int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
_NEXT = itertools.count(os.getpid())


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    """Return a port that nobody has, and that neither the system nor another worker gives away."""
    while True:
        port = _FIRST + next(_NEXT) % _SHARE
        with socket.socket(socket.AF_INET, kind) as free, contextlib.suppress(OSError):
            free.bind(("127.0.0.1", port))
            return port
