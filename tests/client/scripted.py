"""A station that answers as it was told to, for both clients alike."""

import asyncio
import json
from collections.abc import Callable
from typing import Any

import httpx

from grace_client import AsyncStation, Patience, Station
from grace_client.generated import STATION_VERSION

QUICK = Patience(give_up_s=60.0, first_s=0.001, longest_s=0.01)
Answer = Callable[[], httpx.Response] | Exception
"""Made anew for each client: a response is read once."""


class Scripted:
    """Gives its answers one after another, and keeps what it was asked."""

    def __init__(self, *answers: Answer, version: str = STATION_VERSION) -> None:
        self._answers = list(answers)
        self._version = version
        self.asked: list[httpx.Request] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if request.url.path == "/api/health":
            return httpx.Response(200, json={"version": self._version})
        self.asked.append(request)
        answer = self._answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer()

    async def awaited(self, request: httpx.Request) -> httpx.Response:
        return self(request)

    @property
    def said(self) -> list[tuple[str, str, Any]]:
        """Return method, path and body of each request."""
        return [
            (one.method, one.url.raw_path.decode(), json.loads(one.content or b"null"))
            for one in self.asked
        ]


def by_both(*answers: Answer, version: str = STATION_VERSION, **manner: Any):
    """Return two runs of a script, sync and async; each gives what came of it, and the station.

    A run takes a function of the client; what it returns is awaited where it is to be.
    """
    manner.setdefault("patience", QUICK)

    def sync(use: Callable[[Any], Any]) -> tuple[Any, Scripted]:
        station = Scripted(*answers, version=version)
        with Station(
            "http://station", "secret", transport=httpx.MockTransport(station), **manner
        ) as client:
            return _outcome(lambda: use(client)), station

    def asynchronous(use: Callable[[Any], Any]) -> tuple[Any, Scripted]:
        station = Scripted(*answers, version=version)

        async def run() -> Any:
            transport = httpx.MockTransport(station.awaited)
            async with AsyncStation("http://station", "secret", transport=transport, **manner) as c:
                return await use(c)

        return _outcome(lambda: asyncio.run(run())), station

    return sync, asynchronous


def _outcome(run: Callable[[], Any]) -> Any:
    try:
        return run()
    except Exception as error:  # noqa: BLE001 - the test looks at it
        return error


def told(body: Any, status: int = 200, **headers: str) -> Callable[[], httpx.Response]:
    names = {name.replace("_", "-"): value for name, value in headers.items()}
    return lambda: httpx.Response(status, json=body, headers=names)


def job(state: str, **more: Any) -> dict[str, Any]:
    return {
        "id": "job-7",
        "kind": "film",
        "state": state,
        "progress": 0.5,
        "message": "",
        "result": None,
        "created_at": "2026-01-01T00:00:00Z",
        "ended_at": None,
        "robot": None,
        "about": None,
    } | more
