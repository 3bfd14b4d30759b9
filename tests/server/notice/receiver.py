"""Services that people are told by, on loopback: they take, refuse, drip, hang."""

import asyncio
import json
import socket
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Taken:
    """One request that a service got."""

    target: str
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> dict[str, Any]:
        return json.loads(self.body)


@dataclass
class WebService:
    """Answers every request in the way of ``mode``."""

    port: int = 0
    mode: str = "take"
    """``take``, ``refuse``, ``break``, ``drip``, ``hang``, ``mute`` that takes and never says
    so, or ``closed`` until it listens."""
    answer: str = "thank you"
    taken: list[Taken] = field(default_factory=list)
    calls: int = 0
    news: asyncio.Event = field(default_factory=asyncio.Event)
    open: set["asyncio.Task[None]"] = field(default_factory=set)
    bound: socket.socket = field(default_factory=socket.socket)
    _server: asyncio.Server | None = None

    def __post_init__(self) -> None:
        self.bound.bind(("127.0.0.1", 0))
        self.port = self.bound.getsockname()[1]

    async def listen(self) -> None:
        """Take connections; before, they are refused."""
        self._server = await asyncio.start_server(self.serve, sock=self.bound)

    async def close(self) -> None:
        if self._server is None:
            self.bound.close()
        else:
            self._server.close()
        held = list(self.open)
        for task in held:
            task.cancel()
        await asyncio.gather(*held, return_exceptions=True)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/hook"

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self.open.add(task)
        try:
            await self._answer(reader, writer)
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            self.open.discard(task)
            writer.close()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        headers = {
            name.strip().lower(): value.strip()
            for name, _, value in (line.partition(":") for line in head[1:] if line)
        }
        body = await reader.readexactly(int(headers.get("content-length", "0")))
        self.calls += 1
        mode = self.mode
        if mode in ("take", "mute"):
            self.taken.append(Taken(head[0].split(" ")[1], headers, body))
        self.news.set()
        if mode in ("hang", "mute"):
            await reader.read()
            return
        if mode == "drip":
            writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 1000000\r\n\r\n")
            while not reader.at_eof() and not writer.is_closing():
                writer.write(b".")
                await writer.drain()
                await asyncio.sleep(0.05)
            return
        status = {"take": "200 OK", "refuse": "403 Forbidden", "break": "500 Trouble"}[mode]
        text = self.answer.encode()
        writer.write(f"HTTP/1.1 {status}\r\nContent-Length: {len(text)}\r\n\r\n".encode() + text)
        await writer.drain()

    async def until_taken(self, count: int = 1, timeout_s: float = 120.0) -> list[Taken]:
        """Wait until so many requests were taken."""
        async with asyncio.timeout(timeout_s):
            while len(self.taken) < count:
                self.news.clear()
                await self.news.wait()
        return self.taken

    async def until_called(self, count: int = 1, timeout_s: float = 120.0) -> None:
        """Wait until so many requests came, whatever became of them."""
        async with asyncio.timeout(timeout_s):
            while self.calls < count:
                self.news.clear()
                await self.news.wait()


@asynccontextmanager
async def web_service(mode: str = "take") -> AsyncGenerator[WebService]:
    service = WebService(mode=mode)
    if mode != "closed":
        await service.listen()
    try:
        yield service
    finally:
        await service.close()


@dataclass
class MailService:
    """A mail server of few words."""

    port: int = 0
    mails: list[str] = field(default_factory=list)
    refuses: bool = False

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        def say(line: str) -> None:
            writer.write(f"{line}\r\n".encode())

        say("220 mail.test")
        while line := (await reader.readline()).decode().strip():
            verb = line.split(" ")[0].upper()
            if verb == "DATA":
                say("354 go on")
                mail = (await reader.readuntil(b"\r\n.\r\n")).decode()
                self.mails.append(mail)
                say("250 2.0.0 kept as 4711")
            elif verb == "RCPT" and self.refuses:
                say("550 5.1.1 nobody of that name")
            elif verb == "QUIT":
                say("221 bye")
                break
            else:
                say("250 fine")
        writer.close()


@asynccontextmanager
async def mail_service() -> AsyncGenerator[MailService]:
    service = MailService()
    server = await asyncio.start_server(service.serve, "127.0.0.1", 0)
    service.port = server.sockets[0].getsockname()[1]
    try:
        yield service
    finally:
        server.close()
