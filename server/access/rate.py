"""Slows down whoever comes too often: anybody at a door, and scripts by their tokens."""

from http import HTTPStatus
from math import ceil
from typing import Final

from fastapi import Request
from fastapi.dependencies.models import Dependant
from starlette.datastructures import MutableHeaders

from robot_link.clock import monotonic_s
from server.access.caller import Caller
from server.base.job import JobBoard
from server.base.problem import Problem
from server.base.settings import Settings
from server.base.work.job_view import JobView

_KEPT_MAX: Final = 1000
_JOBS_RETRY_S: Final = 5


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


class TokenLimits:
    """Counts the requests and the jobs of each token. Belongs to one event loop.

    Browsers are not counted: a page asks for what it shows. What can bring a robot up is never
    refused.
    """

    def __init__(self, settings: Settings, jobs: JobBoard) -> None:
        self._per_s = settings.token_requests_per_s
        self._burst = settings.token_burst
        self._jobs_max = settings.token_jobs
        self._jobs = jobs
        self._rates: dict[str, RateLimit] = {}

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
        rate = self._rate_of(caller.proof.digest)
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
        if self._begins_job(request) and self._running(caller.name) >= self._jobs_max:
            raise self._refusal(
                f"{caller.name} has {self._jobs_max} jobs under way, which is the limit "
                "(token_jobs).",
                _JOBS_RETRY_S,
            )

    def _rate_of(self, token: str) -> RateLimit:
        rate = self._rates.pop(token, None) or RateLimit(self._burst, self._per_s)
        self._rates[token] = rate
        while len(self._rates) > _KEPT_MAX:
            del self._rates[next(iter(self._rates))]
        return rate

    def _headers(self, rate: RateLimit) -> dict[str, str]:
        return {
            "RateLimit-Limit": str(self._burst),
            "RateLimit-Remaining": str(int(rate.left)),
            "RateLimit-Reset": str(ceil((self._burst - rate.left) / self._per_s)),
        }

    def _begins_job(self, request: Request) -> bool:
        route = request.scope.get("route")
        is_begun = getattr(route, "status_code", None) == HTTPStatus.ACCEPTED
        return is_begun and getattr(route, "response_model", None) is JobView

    def _running(self, name: str) -> int:
        return sum(job.created_by == name for job in self._jobs.running)

    def _refusal(self, detail: str, wait_s: int) -> Problem:
        return Problem(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"{detail} Wait {wait_s} s.",
            headers={"Retry-After": str(wait_s)},
        )


def tell_rate(request: Request, headers: MutableHeaders) -> None:
    """Say in an answer how much its token has left."""
    for name, value in getattr(request.state, "rate_headers", {}).items():
        headers.setdefault(name, value)


def calls_of(dependant: Dependant) -> set[object]:
    """Return everything that a route asks for before it runs."""
    return {dependant.call}.union(*(calls_of(one) for one in dependant.dependencies))
