"""What travels between a node and the programs that use it: JSON lines on a loopback socket.

A program asks ``{"id": 7, "ask": "ping", "with": {"peer": 2}}`` and is told
``{"id": 7, "answer": {...}}``, or ``{"id": 7, "error": "a sentence", "kind": "refused"}``. After
``{"id": 8, "ask": "subscribe", "with": {"topics": ["ring"]}}`` it also gets what the node
publishes, ``{"topic": "ring", "value": {...}}``. Every node answers ``describe``. A line is UTF-8,
ends in a newline and has at most ``LINE_MAX`` bytes. Bytes travel as hexadecimal digits.
"""

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self
from urllib.parse import urlsplit

LINE_MAX = 65536
LOOPBACK = "127.0.0.1"

Content = Mapping[str, Any]
"""What a line says: values that JSON knows."""


class NodeFault(StrEnum):
    """What the asking program can do about an error."""

    UNKNOWN = "unknown"
    """The node does not know such a question: correct the program."""
    BAD = "bad"
    """The question's values are wrong: correct them."""
    REFUSED = "refused"
    """The device cannot do it now: ask later."""
    BUSY = "busy"
    """Too many questions at once: wait for answers first."""
    FAILED = "failed"
    """The node itself failed; its log says why."""


class NodeError(Exception):
    """A node said no; ``fault`` says what to do, the text is a sentence."""

    def __init__(self, fault: NodeFault, sentence: str) -> None:
        super().__init__(sentence)
        self.fault = fault


class NodeGoneError(Exception):
    """There is no connection to the node; it is being made again."""


class NodeSilentError(Exception):
    """The node did not answer in time; it may act nevertheless."""


@dataclass(frozen=True, slots=True)
class NodeAddress:
    """Where a node listens, such as ``tcp://127.0.0.1:4567``; port 0 is any free one."""

    host: str = LOOPBACK
    port: int = 0

    def __post_init__(self) -> None:
        """Refuse addresses that other machines can reach."""
        if self.host not in (LOOPBACK, "::1", "localhost"):
            raise ValueError(f"{self.host}: a node listens on this machine only")

    @classmethod
    def of(cls, text: str) -> Self:
        """Read an address.

        Raises:
            ValueError: If it is none; the sentence says why.
        """
        parts = urlsplit(text)
        if parts.scheme == "tcp" and parts.hostname and parts.port:
            return cls(parts.hostname, parts.port)
        raise ValueError(f"{text!r} is no node's address: tcp://127.0.0.1:PORT")

    def __str__(self) -> str:
        """Return it as ``of`` reads it."""
        return f"tcp://{self.host}:{self.port}"

    async def connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Connect to the node.

        Raises:
            OSError: If nobody listens there.
        """
        return await asyncio.open_connection(self.host, self.port, limit=LINE_MAX)


def line_of(content: Content) -> bytes:
    """Return one line.

    Raises:
        ValueError: If a number is not finite, or the line is too long.
    """
    line = json.dumps(content, separators=(",", ":"), allow_nan=False).encode() + b"\n"
    if len(line) > LINE_MAX:
        raise ValueError(f"a line of {len(line)} bytes; at most {LINE_MAX} travel")
    return line


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no number of JSON")


def content_of(line: bytes) -> dict[str, Any]:
    """Read one line.

    Raises:
        ValueError: If it is not a JSON object; the sentence says why.
    """
    try:
        content = json.loads(line, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ValueError("a line that is not JSON") from error
    if not isinstance(content, dict):
        raise ValueError("a line that is not a JSON object")  # noqa: TRY004 - the bytes are wrong
    return content
