"""As much HTTP/1.1 as an emulated web service needs: one request a connection, on loopback only."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from urllib.parse import parse_qsl, unquote, urlsplit

from simulator.iridium.loopback import connections

_BODY_BYTES = 65536


@dataclass(frozen=True, slots=True)
class Request:
    """What a client asks."""

    method: str
    path: str
    fields: dict[str, str]
    """Of the query and of the form in the body; the form's win."""
    headers: dict[str, str] = field(default_factory=dict[str, str])
    """By their names in small letters."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What it is told."""

    text: str
    status: HTTPStatus = HTTPStatus.OK
    content_type: str = "text/plain"

    def packed(self) -> bytes:
        """Return the answer's bytes."""
        body = self.text.encode()
        head = (
            f"HTTP/1.1 {self.status.value} {self.status.phrase}\r\n"
            f"Content-Type: {self.content_type}; charset=utf-8\r\n"
            f"Content-Length: {len(body)}\r\n"
            "Connection: close\r\n\r\n"
        )
        return head.encode("ascii") + body


Respond = Callable[[Request], Answer | None]
"""Answers a request; None hangs up without a word."""


class _BadRequestError(Exception):
    def __init__(self, status: HTTPStatus) -> None:
        super().__init__(status.phrase)
        self.status = status


@asynccontextmanager
async def http_server(respond: Respond, host: str, port: int = 0) -> AsyncGenerator[str]:
    """Serve until the context is left.

    Yields:
        The server's URL without a path; port 0 asks the system to choose one.

    Raises:
        ValueError: If the host is not this machine itself.
        OSError: If the port is taken.
    """
    async with connections(_Web(respond).take, host, port) as chosen:
        shown = f"[{host}]" if ":" in host else host
        yield f"http://{shown}:{chosen}"


class _Web:
    def __init__(self, respond: Respond) -> None:
        self._respond = respond

    async def take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one request."""
        try:
            answer = self._respond(await _request(reader))
        except _BadRequestError as error:
            answer = Answer(str(error), error.status)
        if answer is None:
            writer.transport.abort()
            return
        writer.write(answer.packed())
        await writer.drain()


async def _request(reader: asyncio.StreamReader) -> Request:
    """Read a request.

    Raises:
        _BadRequestError: If it is none, or too large.
    """
    try:
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
    except asyncio.LimitOverrunError:
        raise _BadRequestError(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE) from None
    first, *rest = head.split("\r\n")
    words = first.split(" ")
    if len(words) != 3 or not words[2].startswith("HTTP/1."):
        raise _BadRequestError(HTTPStatus.BAD_REQUEST)
    headers = {
        name.strip().lower(): value.strip()
        for name, colon, value in (line.partition(":") for line in rest)
        if colon
    }
    body = await _body(reader, headers)
    try:
        target = urlsplit(words[1])
        fields = dict(parse_qsl(target.query, keep_blank_values=True))
        if headers.get("content-type", "").startswith("application/x-www-form-urlencoded"):
            fields |= parse_qsl(body.decode("latin-1"), keep_blank_values=True, max_num_fields=50)
    except ValueError:
        raise _BadRequestError(HTTPStatus.BAD_REQUEST) from None
    return Request(words[0], unquote(target.path), fields, headers)


async def _body(reader: asyncio.StreamReader, headers: dict[str, str]) -> bytes:
    if "transfer-encoding" in headers:
        raise _BadRequestError(HTTPStatus.LENGTH_REQUIRED)
    length = headers.get("content-length", "0")
    if not (length.isascii() and length.isdecimal()) or len(length) > 12:
        raise _BadRequestError(HTTPStatus.BAD_REQUEST)
    if int(length) > _BODY_BYTES:
        raise _BadRequestError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
    return await reader.readexactly(int(length))
