"""One process of a station takes over from another while radios and browsers stay.

The running process starts the new one and speaks with it over a pair of sockets; each line is a
message, the descriptors of radio lines travel beside them:

===============  ===================  =============================================================
who says it      message              what has happened
===============  ===================  =============================================================
the new one      ``preparing``        it packs a backup, and has come further
the new one      ``prepared``         its program is loaded, its settings and the database fit
the new one      ``refused``          instead: it cannot serve, and says why
the running one  ``yours``            it serves nobody any more and has let go of the database
the new one      ``ready``            it has started, and lacks the lines of the radios alone
the running one  ``heard``, ``line``  what a line brought meanwhile, then the line itself
the running one  ``end``              these were all
the new one      ``taken``            it has them; nobody has read any of them since ``end``
===============  ===================  =============================================================

The listening socket and the lock of the data folder belong to both from the start, so connections
wait in the socket's queue and no third process comes in between.

Until ``taken`` the running process has everything: the lines, open, and all that they brought. The
new one reads no line before it has said so. So whenever the new one ends, either ``taken`` was said
and it was the station, or it was not and the running one takes up all that there is.
"""

import asyncio
import contextlib
import json
import os
import socket
import subprocess
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from robot_link.clock import monotonic_s
from robot_link.transport.shelf import KeptLine, Sender, Shelf
from server.cli.service.manager import OF_ONE_PROCESS, ServiceManager

PREPARED_S: Final = 900.0
"""Longest time of a preparation without a word; it may pack a backup, and tells how that goes."""
STARTED_S: Final = 900.0
"""Longest time from letting go to being ready, which may change the schema of the database."""
_ANSWER_S: Final = 30.0
"""Longest wait for the other process amid a handover."""
_SIGN_OF_LIFE_S: Final = 5.0
_PREPARING_PERIOD_S: Final = 1.0
_MESSAGE_BYTES: Final = 1 << 18
OPTION: Final = "--take-over"


class SuccessionError(Exception):
    """The new process does not take over; the sentence says why."""


class Heirloom(NamedTuple):
    """Descriptors that both processes have, as the option of the new one names them."""

    channel: int
    listener: int
    lock: int

    @classmethod
    def parse(cls, text: str) -> "Heirloom":
        """Return what the option says."""
        return cls(*(int(number) for number in text.split(",")))

    def __str__(self) -> str:
        return ",".join(map(str, self))


class Channel:
    """One end of the pair of sockets. Belongs to one event loop, or to one thread at a time."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        end.settimeout(_ANSWER_S)

    def say(self, word: str, descriptor: int | None = None, **more: object) -> None:
        """Send a message, with a descriptor beside it if one is given.

        Raises:
            EOFError: If the other process has ended.
            TimeoutError: If it takes nothing.
        """
        data = json.dumps({"is": word, **more}).encode()
        try:
            socket.send_fds(self._end, [data], [] if descriptor is None else [descriptor])
        except ConnectionError as error:
            raise EOFError from error

    def hear(self) -> tuple[Mapping[str, Any], list[int]]:
        """Wait for the next message; return it and its descriptors.

        Raises:
            EOFError: If the other process has ended.
            TimeoutError: If it says nothing.
        """
        try:
            data, descriptors, _, _ = socket.recv_fds(self._end, _MESSAGE_BYTES, 1)
        except ConnectionError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        return json.loads(data), descriptors

    async def next(self) -> Mapping[str, Any]:
        """Return the next message, and leave the event loop free meanwhile.

        Raises:
            EOFError: If the other process has ended.
        """
        loop = asyncio.get_running_loop()
        ready = asyncio.Event()
        loop.add_reader(self._end, ready.set)
        try:
            await ready.wait()
        finally:
            loop.remove_reader(self._end)
        return self.hear()[0]

    def close(self) -> None:
        """End the conversation."""
        self._end.close()


class Successor:
    """The new process, as the running one sees it."""

    def __init__(self, process: subprocess.Popen[bytes], channel: Channel) -> None:
        self._process = process
        self._channel = channel
        self._lent: dict[str, KeptLine] = {}

    @classmethod
    async def start(
        cls, python: str, words: Sequence[str], listener: socket.socket, lock: int
    ) -> "Successor":
        """Start the new process, and return once it is prepared.

        Args:
            python: Interpreter of its installation.
            words: Command line of the running process.
            listener: Socket that browsers connect to.
            lock: Descriptor of the data folder's lock.

        Raises:
            SuccessionError: If it cannot be prepared.
        """
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            heirloom = Heirloom(theirs.fileno(), listener.fileno(), lock)
            try:
                process = _process(python, words, heirloom)
            except OSError as error:
                ours.close()
                raise SuccessionError(f"{python} cannot be started ({error.strerror})") from error
        successor = cls(process, Channel(ours))
        try:
            message = await successor._prepared()
        except (EOFError, TimeoutError) as error:
            await successor.end()
            raise SuccessionError("it did not start; its log says why") from error
        except asyncio.CancelledError:
            await successor.end()
            raise
        if message["is"] != "prepared":
            await successor.end()
            raise SuccessionError(str(message["why"]))
        return successor

    async def _prepared(self) -> Mapping[str, Any]:
        """Return what it says once it is prepared, or refuses."""
        while True:
            async with asyncio.timeout(PREPARED_S):
                message = await self._channel.next()
            if message["is"] != "preparing":
                return message

    async def take_over(self, shelf: Shelf, manager: ServiceManager) -> None:
        """Hand everything over.

        Raises:
            SuccessionError: If it did not take everything; the lines are on the shelf again.
        """
        try:
            self._channel.say("yours")
            async with asyncio.timeout(STARTED_S):
                await self._wait_for("ready", manager)
                self._lend(shelf)
                await self._wait_for("taken", manager)
        except (EOFError, TimeoutError) as error:
            await self.end()
            for uri, line in self._lent.items():
                shelf.put(uri, line)
            raise SuccessionError("it ended before it served; its log says why") from error
        manager.succeeded_by(self._process.pid)
        for line in self._lent.values():
            os.close(line.descriptor)

    @property
    def has_ended(self) -> bool:
        """Whether the new process is gone already."""
        return self._process.poll() is not None

    async def _wait_for(self, word: str, manager: ServiceManager) -> None:
        while True:
            manager.alive()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_SIGN_OF_LIFE_S):
                    message = await self._channel.next()
                    if message["is"] == word:
                        return

    def _lend(self, shelf: Shelf) -> None:
        for uri in shelf.uris:
            line = shelf.take(uri)
            if line is None:
                continue
            self._lent[uri] = line
            for data, sender in line.heard:
                self._channel.say("heard", uri=uri, data=data.hex(), sender=sender)
            self._channel.say("line", line.descriptor, uri=uri, name=line.name)
        self._channel.say("end")

    async def end(self) -> None:
        """End the new process, if it has not ended."""
        self._channel.close()
        self._process.kill()
        await asyncio.to_thread(self._process.wait)


def _process(python: str, words: Sequence[str], heirloom: Heirloom) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [python, "-P", "-m", "server.cli", *words, OPTION, str(heirloom)],
        pass_fds=heirloom,
        env={k: v for k, v in os.environ.items() if k not in OF_ONE_PROCESS},
    )


class Predecessor(Shelf):
    """The running process, as the new one sees it: the shelf on which its radios' lines are."""

    def __init__(self, heirloom: Heirloom) -> None:
        super().__init__()
        self._channel = Channel(socket.socket(fileno=heirloom.channel))
        self._said_at_s = -_PREPARING_PERIOD_S
        self._is_filled = asyncio.Event()

    def preparing(self, share: float, words: str) -> None:
        """Say that the preparation has come further, now and then. May be called from a thread.

        Raises:
            EOFError: If the running process has ended.
        """
        now_s = monotonic_s()
        if now_s >= self._said_at_s + _PREPARING_PERIOD_S:
            self._said_at_s = now_s
            self._channel.say("preparing", share=share, words=words)

    async def wait(self) -> None:
        """Say that all is prepared, and wait until the running process has let go.

        Raises:
            SuccessionError: If it has ended, or wants no successor any more.
        """
        try:
            self._channel.say("prepared")
            await self._channel.next()
        except EOFError as error:
            raise SuccessionError("the running station did not let go") from error

    def refuse(self, why: str) -> None:
        """Say why this process does not take over."""
        with contextlib.suppress(EOFError):
            self._channel.say("refused", why=why)

    async def filled(self) -> None:
        """Wait until the lines of the radios are here."""
        await self._is_filled.wait()

    async def fill(self) -> None:
        """Fetch the lines of the radios, and what they brought meanwhile.

        A thread does it: between the last words of the running process and ``taken`` nobody reads
        the lines. When the running process has ended amid this, what has come is what there is.
        """
        for uri, line in (await asyncio.to_thread(self._fetch)).items():
            self.put(uri, line)
        self._channel.close()
        self._is_filled.set()

    def _fetch(self) -> Mapping[str, KeptLine]:
        heard: dict[str, list[tuple[bytes, Sender]]] = {}
        lines: dict[str, KeptLine] = {}
        with contextlib.suppress(EOFError):
            self._channel.say("ready")
            while (message := (said := self._channel.hear())[0])["is"] != "end":
                uri = message["uri"]
                if message["is"] == "heard":
                    sender = message["sender"]
                    data = bytes.fromhex(message["data"])
                    heard.setdefault(uri, []).append((data, sender and tuple(sender)))
                else:
                    lines[uri] = KeptLine(said[1][0], message["name"], heard.pop(uri, []))
            self._channel.say("taken")
        return lines
