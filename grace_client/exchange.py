"""One request and its repetitions, without I/O: what to send, how long to wait, what it means.

A *flow* is a generator. It yields what is to be done, a ``Call`` or a ``Pause``, is sent what came
of that, and returns its result. ``Station`` and ``AsyncStation`` only carry out what flows yield,
so that both do the same by construction.
"""

import random
import time
import uuid
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias, TypeVar

import httpx
from pydantic import BaseModel

from grace_client.problem import NotSentError, UnreachableError, problem_of, retry_after_s

KEY_HEADER = "Idempotency-Key"
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Call:
    """One request."""

    method: str
    path: str
    """With its values in place, such as ``/api/plans/plan-7``."""
    query: Mapping[str, Any] = field(default_factory=dict[str, Any])
    body: Any = None
    """A model, or what JSON can say."""
    files: Sequence[tuple[str, Any]] = ()
    form: Mapping[str, Any] = field(default_factory=dict[str, Any])
    headers: Mapping[str, str] = field(default_factory=dict[str, str])
    takes_key: bool = False
    """Whether the station acts once on requests that carry the same key."""
    sends: Literal["always", "by its body"] | None = None
    """Whether it sends a robot something."""
    timeout_s: float | None = None
    """How long the answer may take; by default as the client was told."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Wait before the next step."""

    seconds: float


Step: TypeAlias = Call | Pause
Reply: TypeAlias = httpx.Response | httpx.TransportError | None
Flow: TypeAlias = Generator[Step, Reply, T]


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a client tries.

    The n-th repetition of what failed waits ``first_s * 2**n``, at most ``longest_s``, with half
    of it drawn at random, so that many clients do not come back at the same moment.
    """

    give_up_s: float = 60.0
    """Waits in sum, after which a request is given up."""
    first_s: float = 0.25
    longest_s: float = 8.0
    draw: Callable[[], float] = random.random
    """Uniform in 0 .. 1."""

    def pause_s(self, failures: int, wanted_s: float | None) -> float:
        """Return the wait after so many failures, never less than the station wants."""
        full_s = min(self.longest_s, self.first_s * 2.0**failures)
        return max(wanted_s or 0.0, full_s * (0.5 + 0.5 * self.draw()))


def refuse_to_send(call: Call) -> None:
    """Refuse a call that would send a robot something.

    *Surface now* is no such call: it brings a robot up, and whoever writes it means it.

    Raises:
        NotSentError: Nothing was asked of the station.
    """
    body = as_json(call.body) or {}
    if call.sends == "by its body":
        order = body.get("kind") if call.path.endswith("/commands") else None
        sends = body.get("automation", False) if order is None else order != "surface"
    else:
        sends = call.sends is not None
    if sends:
        raise NotSentError(
            f"{call.method} {call.path} sends a robot something. Nothing was sent; make the "
            "client with may_send=True if it shall."
        )


def exchange(call: Call, patience: Patience) -> Flow[httpx.Response]:
    """Ask once, and again where that changes nothing twice.

    Repeated are reads, and requests with an idempotency key, which every call that takes one is
    given; what was refused before it was begun (429) is repeated in any case.

    Raises:
        UnreachableError: Nobody answered.
        ProblemError: The station refused, or failed.
    """
    if call.takes_key and KEY_HEADER not in call.headers:
        call = replace(call, headers={**call.headers, KEY_HEADER: str(uuid.uuid4())})
    is_safe = call.method == "GET" or KEY_HEADER in call.headers
    waited_s, failures = 0.0, 0
    while True:
        reply = yield call
        if isinstance(reply, httpx.Response) and reply.is_success:
            return reply
        wanted_s = retry_after_s(reply) if isinstance(reply, httpx.Response) else None
        pause_s = patience.pause_s(failures, wanted_s)
        may_repeat = _may_repeat(reply, is_safe=is_safe)
        if not may_repeat or waited_s + pause_s > patience.give_up_s:
            if isinstance(reply, httpx.Response):
                raise problem_of(reply)
            raise UnreachableError(f"{call.method} {call.path}: {reply}") from reply
        yield Pause(pause_s)
        waited_s += pause_s
        failures += 1


def _may_repeat(reply: Reply, *, is_safe: bool) -> bool:
    if not isinstance(reply, httpx.Response):
        return is_safe or isinstance(reply, httpx.ConnectError)
    status = reply.status_code
    if status == 429:
        return True
    if status == 409:  # the first request with this key is still being worked on
        return is_safe and retry_after_s(reply) is not None
    return is_safe and status in {502, 503, 504}


def as_json(body: Any) -> Any:  # noqa: ANN401 - whatever JSON can say
    """Return a body as JSON has it; of a model, the fields that were given."""
    if isinstance(body, BaseModel):
        return body.model_dump(mode="json", exclude_unset=True, by_alias=True)
    return body


def now_s() -> float:
    """Return the monotonic clock, s."""
    return time.monotonic()
