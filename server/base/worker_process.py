"""The other side of ``server.base.worker``: a process that does one heavy task after another.

It is the only place of the station where numba is loaded. Messages are pickles, each preceded by
its length, on the pipes that the station opened; whoever can write to them is the station itself.
The process ends when its input closes, so it never outlives a station that was killed.
"""

import importlib
import os
import pickle
import queue
import struct
import sys
import threading
import traceback
from collections.abc import Callable
from functools import partial
from typing import IO, Any

LENGTH = struct.Struct("<I")
CALL, CANCEL = "call", "cancel"
PROGRESS, RESULT, FAILURE, READY = "progress", "result", "failure", "ready"


def frame(message: object) -> bytes:
    """Return a message as it crosses the pipe."""
    body = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    return LENGTH.pack(len(body)) + body


class _Pipe:
    """The two ends of the pipe in the worker; printing anywhere in a task cannot disturb it."""

    def __init__(self) -> None:
        self._incoming: IO[bytes] = os.fdopen(os.dup(0), "rb")
        self._outgoing: IO[bytes] = os.fdopen(os.dup(1), "wb")
        os.dup2(2, 1)
        self._lock = threading.Lock()

    def receive(self) -> tuple[Any, ...] | None:
        head = self._incoming.read(LENGTH.size)
        if len(head) < LENGTH.size:
            return None
        return pickle.loads(self._incoming.read(LENGTH.unpack(head)[0]))

    def send(self, *message: object) -> None:
        with self._lock:
            self._outgoing.write(frame(message))
            self._outgoing.flush()


def _sentence(error: Exception) -> str:
    """Return the first line of what an error says; all of it stands in the log."""
    lines = str(error).splitlines() or [""]
    return f"{type(error).__name__}: {lines[0]}"


def _resolve(task: str) -> Callable[..., Any]:
    module, _, name = task.partition(":")
    return getattr(importlib.import_module(module), name)


def _listen(pipe: _Pipe, calls: "queue.Queue[tuple[str, Any]]", cancelled: threading.Event) -> None:
    while (message := pipe.receive()) is not None:
        if message[0] == CANCEL:
            cancelled.set()
        else:
            cancelled.clear()
            calls.put((message[1], message[2]))
    os._exit(0)


def main(niceness: int) -> None:
    """Serve tasks until the input closes, giving way to others by ``niceness``."""
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    pipe = _Pipe()
    calls: queue.Queue[tuple[str, Any]] = queue.Queue()
    cancelled = threading.Event()
    threading.Thread(target=_listen, args=(pipe, calls, cancelled), daemon=True).start()
    pipe.send(READY)
    while True:
        task, payload = calls.get()
        try:
            result = _resolve(task)(payload, partial(pipe.send, PROGRESS), cancelled.is_set)
        except Exception as error:  # noqa: BLE001 - whatever a task raises is the station's to tell
            if not cancelled.is_set():  # one that was told to stop may say so by an exception
                traceback.print_exc()
            pipe.send(FAILURE, _sentence(error))
        else:
            pipe.send(RESULT, result)


if __name__ == "__main__":
    main(int(sys.argv[1]))
