"""Slows down whoever comes too often: anybody at a door, and scripts by their tokens."""

from collections.abc import Callable
from dataclasses import dataclass, field
from http import HTTPStatus
from math import ceil
from typing import Final, TypeAlias

from fastapi import Request
from fastapi.dependencies.models import Dependant
from starlette.datastructures import MutableHeaders

from robot_link.clock import monotonic_s
from server.access.caller import Caller
from server.base.job import JobBoard
from server.base.problem import Problem
from server.base.settings import Settings
from server.base.work.job_view import JobAnswer
from server.base.work.started import BEGUN, CalculatedAnswer

_KEPT_MAX: Final = 1000
_WORK_RETRY_S: Final = 5
_BEGIN_WORK: Final = frozenset({JobAnswer, CalculatedAnswer})
"""How routes answer that begin long work."""
IsUnderWay: TypeAlias = Callable[[str], bool]
"""Tells by its id whether work is under way."""


class RateLimit:
    """Lets so many come at once, and then so many a second.

    Args:
        burst: How many may come at once.
        per_s: How many may come in each second after that.
    """

    def __init__(self, burst: int, per_s: float) -> None:
        self._burst = float(burst)
        self._per_s = per_s
        self._left = float(burst)
        self._counted_s = monotonic_s()

    @property
    def left(self) -> float:
        """How many more may come now; a part of one is on its way."""
        return self._left

    def admits(self) -> bool:
        """Tell whether one more may come now, and count it if so."""
        now_s = monotonic_s()
        self._left = min(self._burst, self._left + (now_s - self._counted_s) * self._per_s)
        self._counted_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True


@dataclass(slots=True)
class _Token:
    """What is counted of one token."""

    rate: RateLimit
    requests: int = 0
    """Requests that are being answered and may begin work."""
    begun: set[str] = field(default_factory=set[str])
    """Ids of work that it began, some of which may have ended."""


class TokenLimits:
    """Counts the requests of each token, and its work. Belongs to one event loop.

    Browsers are not counted: a page asks for what it shows. What can bring a robot up is never
    refused.
    """

    def __init__(self, settings: Settings, jobs: JobBoard) -> None:
        self._per_s = settings.token_requests_per_s
        self._burst = settings.token_burst
        self._work_max = settings.token_jobs
        self._is_under_way: dict[str, IsUnderWay] = {"job": jobs.is_running}
        self._tokens: dict[str, _Token] = {}

    def add_work(self, kind: str, is_under_way: IsUnderWay) -> None:
        """Count work of another kind too; ``kind`` is how its ids begin."""
        self._is_under_way[kind] = is_under_way

    def admit(self, caller: Caller, request: Request, *, is_at_once: bool) -> None:
        """Count a request of a token, once, however often its caller is asked for.

        Args:
            caller: Whose it is.
            request: What is asked.
            is_at_once: Whether it can bring a robot up, and is let through in any case.

        Raises:
            Problem: 429, with the seconds to wait in ``Retry-After``.
        """
        if caller.proof.kind != "token" or getattr(request.state, "is_counted", False):
            return
        request.state.is_counted = True
        token = self._token(caller.proof.digest)
        rate = token.rate
        is_over = not rate.admits()
        request.state.rate_headers = self._headers(rate)
        if is_at_once:
            return
        if is_over:
            raise self._refusal(
                f"{caller.name} asks more than {self._per_s:g} times a second "
                f"(token_requests_per_s), beyond {self._burst} at once (token_burst).",
                ceil((1.0 - rate.left) / self._per_s),
            )
        if _begins_work(request):
            if token.requests + self._count_under_way(token) >= self._work_max:
                raise self._refusal(
                    f"{caller.name} has {self._work_max} jobs and plans under way, which is the "
                    "limit (token_jobs).",
                    _WORK_RETRY_S,
                )
            token.requests += 1
            request.state.counted_for = token

    def _token(self, digest: str) -> _Token:
        token = self._tokens.pop(digest, None) or _Token(RateLimit(self._burst, self._per_s))
        self._tokens[digest] = token
        while len(self._tokens) > _KEPT_MAX:
            del self._tokens[next(iter(self._tokens))]
        return token

    def _count_under_way(self, token: _Token) -> int:
        checks = self._is_under_way
        token.begun = {
            work
            for work in token.begun
            if (check := checks.get(work.partition("-")[0])) is not None and check(work)
        }
        return len(token.begun)

    def _headers(self, rate: RateLimit) -> dict[str, str]:
        return {
            "RateLimit-Limit": str(self._burst),
            "RateLimit-Remaining": str(int(rate.left)),
            "RateLimit-Reset": str(ceil((self._burst - rate.left) / self._per_s)),
        }

    def _refusal(self, detail: str, wait_s: int) -> Problem:
        return Problem(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"{detail} Wait {wait_s} s.",
            headers={"Retry-After": str(wait_s)},
        )


def settle_work(request: Request) -> None:
    """Count what a request began, once it is answered or has failed, and no more the request."""
    token: _Token | None = getattr(request.state, "counted_for", None)
    if token is None:
        return
    request.state.counted_for = None
    token.requests -= 1
    if (begun := getattr(request.state, BEGUN, None)) is not None:
        token.begun.add(begun)


def tell_rate(request: Request, headers: MutableHeaders) -> None:
    """Say in an answer how much its token has left."""
    for name, value in getattr(request.state, "rate_headers", {}).items():
        headers.setdefault(name, value)


def _begins_work(request: Request) -> bool:
    route = request.scope.get("route")
    is_begun = getattr(route, "status_code", None) == HTTPStatus.ACCEPTED
    dependant = getattr(route, "dependant", None)
    return (
        is_begun
        and isinstance(dependant, Dependant)
        and not _BEGIN_WORK.isdisjoint(calls_of(dependant))
    )


def calls_of(dependant: Dependant) -> set[object]:
    """Return everything that a route asks for before it runs."""
    return {dependant.call}.union(*(calls_of(one) for one in dependant.dependencies))
