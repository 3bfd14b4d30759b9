"""Browsers without a screen: viewers of the live stream, readers of REST, and one that stalls.

``python -m benchmarks.station.viewer_crowd ADDRESS TOKEN VIEWERS READERS SECONDS STALLED`` watches
a station and prints one JSON object: ages of states at every viewer, and how long each answer took.
"""

import asyncio
import json
import socket
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime

import httpx
import msgspec
import numpy as np
import websockets

SETTLE_S = 4.0
REST_S = 1.0
"""Between two questions of one reader: as often as a page reads again what changes all the time."""
OPENING_S = 120.0


class _Position(msgspec.Struct):
    measured_at: datetime


class _Robot(msgspec.Struct):
    position: _Position | None


class _Batch(msgspec.Struct):
    robots: dict[str, _Robot]


_batch = msgspec.json.Decoder(_Batch)


@dataclass
class Seen:
    """What a crowd came to."""

    ages_ms: list[float] = field(default_factory=list)
    """Of each state when a viewer first has it."""
    answers_ms: list[float] = field(default_factory=list)
    refused: int = 0
    batches: int = 0
    bytes: int = 0

    def clear(self) -> None:
        """Forget what was seen so far."""
        self.__init__()


def age_ms(seen: Seen, percent: float) -> float:
    """Return a percentile of the ages."""
    return float(np.percentile(seen.ages_ms, percent))


def answer_ms(seen: Seen, percent: float) -> float:
    """Return a percentile of how long answers took."""
    return float(np.percentile(seen.answers_ms, percent))


def begin(
    address: str, token: str, viewers: int, readers: int, seconds: float, *, stalled: bool = False
) -> "subprocess.Popen[str]":
    """Start a crowd in a process of its own; its output is read by ``end``."""
    numbers = map(str, (viewers, readers, seconds, int(stalled)))
    command = [sys.executable, "-m", __name__, address, token, *numbers]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)


def ready(crowd: "subprocess.Popen[str]") -> None:
    """Wait until everybody watches and the measured time begins."""
    assert crowd.stdout is not None  # noqa: S101 - a pipe was asked for
    crowd.stdout.readline()


def end(crowd: "subprocess.Popen[str]") -> Seen:
    """Wait until a crowd has seen enough, and return what it saw."""
    return Seen(**json.loads(crowd.communicate()[0]))


async def watch(
    address: str, token: str, viewers: int, readers: int, seconds: float, *, stalled: bool
) -> Seen:
    """Watch a station for some time after everybody is there."""
    seen = Seen()
    headers = {"Authorization": f"Bearer {token}"}
    uri = f"ws://{address}/api/live"
    silent = _stalled(address, token) if stalled else None
    streams = [
        await websockets.connect(
            uri, additional_headers=headers, compression=None, open_timeout=OPENING_S
        )
        for _ in range(viewers)
    ]
    async with httpx.AsyncClient(
        base_url=f"http://{address}",
        headers=headers,
        timeout=OPENING_S,
        limits=httpx.Limits(max_connections=None),
        trust_env=False,
    ) as client:
        questions = await _questions(client)
        tasks = [asyncio.create_task(_view(stream, seen)) for stream in streams]
        tasks += [
            asyncio.create_task(_read(client, questions, number, readers, seen))
            for number in range(readers)
        ]
        await asyncio.sleep(SETTLE_S)
        print("ready", flush=True)
        seen.clear()
        await asyncio.sleep(seconds)
        found = Seen(**asdict(seen))
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for stream in streams:
        stream.transport.abort()
    if silent is not None:
        silent.close()
    return found


def _stalled(address: str, token: str) -> socket.socket:
    """Ask for the live stream and never read a byte of it."""
    host, port = address.split(":")
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.connect((host, int(port)))
    lines = (
        "GET /api/live HTTP/1.1",
        f"Host: {address}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        f"Authorization: Bearer {token}",
    )
    client.sendall("\r\n".join((*lines, "", "")).encode())
    return client


async def _view(stream: websockets.ClientConnection, seen: Seen) -> None:
    newest: dict[str, datetime] = {}
    async for text in stream:
        now = datetime.now(UTC)
        seen.batches += 1
        seen.bytes += len(text)
        for name, robot in _batch.decode(text).robots.items():
            told = robot.position
            if told is not None and newest.get(name) != told.measured_at:
                newest[name] = told.measured_at
                seen.ages_ms.append((now - told.measured_at).total_seconds() * 1e3)


async def _questions(client: httpx.AsyncClient) -> list[str]:
    """Return what the pages Fleet, Robot and Log ask for, in turn."""
    robots = [robot["id"] for robot in (await client.get("/api/robots")).json()]
    asked = ["/api/robots", "/api/alarms", "/api/health", "/api/leases", "/api/events?limit=100"]
    for robot in robots:
        asked += ["/api/robots", f"/api/robots/{robot}/track?max_points=600"]
        asked.append(f"/api/robots/{robot}/samples?channel=depth_m&max_points=240")
        asked.append(f"/api/robots/{robot}/state")
    return asked


async def _read(
    client: httpx.AsyncClient, questions: list[str], number: int, readers: int, seen: Seen
) -> None:
    await asyncio.sleep(REST_S * number / readers)
    while True:
        for at in range(len(questions)):
            asked_s = time.monotonic()
            answer = await client.get(questions[(at + 7 * number) % len(questions)])
            taken_s = time.monotonic() - asked_s
            seen.answers_ms.append(1e3 * taken_s)
            seen.refused += answer.status_code >= 400
            await asyncio.sleep(max(0.0, REST_S - taken_s))


def main(address: str, token: str, *numbers: str) -> None:
    viewers, readers, seconds, stalled = numbers
    watching = watch(
        address, token, int(viewers), int(readers), float(seconds), stalled=stalled == "1"
    )
    print(json.dumps(asdict(asyncio.run(watching))), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
