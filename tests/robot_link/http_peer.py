"""An HTTP server of a few lines, which keeps what it was asked, byte by byte."""

import asyncio
from collections.abc import AsyncGenerator, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from tests.tcp_peer import serving


@dataclass
class Request:
    head: str
    body: bytes

    @property
    def line(self) -> str:
        return self.head.split("\r\n", 1)[0]


@dataclass
class HttpPeer:
    url: str = ""
    requests: list[Request] = field(default_factory=list)


@asynccontextmanager
async def http_peer(
    answers: Iterable[tuple[int, str] | None],
) -> AsyncGenerator[HttpPeer, None]:
    """Answer each request with the next (status, text); None lets the request wait for ever."""
    peer = HttpPeer()
    waiting = list(answers)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode()
        length = int(head.lower().split("content-length:")[1].split("\r\n")[0])
        peer.requests.append(Request(head, await reader.readexactly(length)))
        answer = waiting.pop(0)
        if answer is None:
            await asyncio.Event().wait()
            return
        status, text = answer
        body = text.encode()
        location = "Location: http://127.0.0.1:1/elsewhere\r\n" if status == 302 else ""
        writer.write(
            f"HTTP/1.1 {status} Said\r\nContent-Length: {len(body)}\r\n{location}"
            "Connection: close\r\n\r\n".encode()
        )
        writer.write(body)
        await writer.drain()

    async with serving(serve) as port:
        peer.url = f"http://127.0.0.1:{port}"
        yield peer
