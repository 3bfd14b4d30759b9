"""What the running process does with one that is to take over from it."""

import asyncio
import socket
import subprocess
import sys

import pytest

from server.cli.service import succession
from server.cli.service.succession import (
    PREPARED_S,
    Channel,
    SuccessionError,
    Successor,
)


class Preparing:
    """A new process that says words, each so many seconds of the event loop after the last."""

    def __init__(self, monkeypatch, *said):
        self._said = list(said)
        self._loop = asyncio.get_running_loop()
        self._passed_s = 0.0
        now_s = self._loop.time
        monkeypatch.setattr(self._loop, "time", lambda: now_s() + self._passed_s, raising=False)
        monkeypatch.setattr(Channel, "next", lambda _: self._next())
        monkeypatch.setattr(succession, "_process", lambda *_: self._sleeping())

    async def _next(self):
        after_s, word = self._said.pop(0)
        self._passed_s += after_s
        for _ in range(3):  # whoever waits too long is told so
            await asyncio.sleep(0)
        return {"is": word}

    @staticmethod
    def _sleeping():
        return subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])

    async def start(self):
        with socket.socket() as listener:
            return await Successor.start(sys.executable, [], listener, 0)


async def test_a_preparation_may_take_long_as_long_as_it_tells_how_far_it_is(monkeypatch):
    words = [(0.7 * PREPARED_S, "preparing")] * 4
    new = Preparing(monkeypatch, *words, (0.7 * PREPARED_S, "prepared"))
    successor = await new.start()
    assert not successor.has_ended
    await successor.end()


async def test_a_preparation_that_says_nothing_for_too_long_is_ended(monkeypatch):
    new = Preparing(monkeypatch, (1.1 * PREPARED_S, "prepared"))
    with pytest.raises(SuccessionError, match="did not start"):
        await new.start()
