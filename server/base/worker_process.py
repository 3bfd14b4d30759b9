"""The other side of ``server.base.worker``: a process that does one heavy task after another.

It is the only place of the station where numba is loaded. Messages are pickles, each preceded by
its length, on the pipes that the station opened; whoever can write to them is the station itself.
The process ends when its input closes, so it never outlives a station that was killed.
"""

import ctypes
import importlib
import os
import pickle
import queue
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import IO, Any

IDLE_S = 1.0
"""A process that has nothing to do for so long gives back what its tasks left free."""
LENGTH = struct.Struct("<I")
CALL, CANCEL = "call", "cancel"
PROGRESS, RESULT, FAILURE, SPENT, READY = "progress", "result", "failure", "spent", "ready"
"""A result comes with the number of the question whether to stop that was answered with yes first;
``None`` where none was."""


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


class _Allowance:
    """What a task may use of the processor; waiting, and a busy machine, cost nothing of it."""

    def __init__(self, limit_s: float | None) -> None:
        self._until_s = None if limit_s is None else time.process_time() + limit_s

    def is_spent(self) -> bool:
        return self._until_s is not None and time.process_time() > self._until_s


class Question:
    """What a task asks whether to stop; it counts how often until the answer is yes."""

    def __init__(self, must_stop: Callable[[], bool]) -> None:
        self._must_stop = must_stop
        self._asked = 0
        self.stopped_at: int | None = None

    def __call__(self) -> bool:
        """Tell whether to stop."""
        self._asked += 1
        stops = self._must_stop()
        if stops and self.stopped_at is None:
            self.stopped_at = self._asked
        return stops


def _listen(pipe: _Pipe, calls: "queue.Queue[tuple[Any, ...]]", cancelled: threading.Event) -> None:
    while (message := pipe.receive()) is not None:
        if message[0] == CANCEL:
            cancelled.set()
        else:
            cancelled.clear()
            calls.put(message[1:])
        del message  # the task alone holds what it is given, and lets go of it at its end
    os._exit(0)


def main(niceness: int) -> None:
    """Serve tasks until the input closes, giving way to others by ``niceness``."""
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    pipe = _Pipe()
    calls: queue.Queue[tuple[Any, ...]] = queue.Queue()
    cancelled = threading.Event()
    threading.Thread(target=_listen, args=(pipe, calls, cancelled), daemon=True).start()
    pipe.send(READY)
    while True:
        _do(pipe, cancelled, *_next(calls))


def trim() -> None:
    """Give back what is free between blocks that are in use, in every arena; elsewhere do nothing.

    By itself glibc gives back what is free at the end of an arena alone. It takes some 20 ms for
    170 MB.
    """
    if sys.platform.startswith("linux"):
        with suppress(AttributeError):
            ctypes.CDLL(None).malloc_trim(0)


def _next(calls: "queue.Queue[tuple[Any, ...]]") -> tuple[Any, ...]:
    """Wait for a task; one that is long in coming finds the memory of the last given back.

    Flights and maps leave holes between what stays, such as machine code: 170 MB after one plan.
    """
    try:
        return calls.get(timeout=IDLE_S)
    except queue.Empty:
        trim()
        return calls.get()


def _do(
    pipe: _Pipe, cancelled: threading.Event, task: str, payload: object, limit_s: float | None
) -> None:
    """Do one task; one that is told to stop may say so by an exception."""
    allowance = _Allowance(None)
    try:
        work = _resolve(task)
        allowance = _Allowance(limit_s)
        question = Question(lambda: cancelled.is_set() or allowance.is_spent())
        result = work(payload, partial(pipe.send, PROGRESS), question)
    except Exception as error:  # noqa: BLE001 - whatever a task raises is the station's to tell
        if allowance.is_spent():
            pipe.send(SPENT)
            return
        if not cancelled.is_set():
            traceback.print_exc()
        pipe.send(FAILURE, _sentence(error))
    else:
        pipe.send(RESULT, result, question.stopped_at)


if __name__ == "__main__":
    main(int(sys.argv[1]))
