"""What can go wrong, ordered by what the caller can do about it.

::

    StationError
    ├── UnreachableError      try again later: the station does not answer
    ├── VersionError          install the client that fits the station
    ├── NotSentError          say may_send=True, if that is meant
    ├── JobFailedError        read why; `job` has what it left
    └── ProblemError          the station refused, in words (RFC 9457)
        ├── InvalidError          422: mend the fields that `fields` names
        ├── UnknownError          404: there is no such thing, or it is not yours to see
        ├── NotAllowedError       401, 403: another token, or the right
        ├── ConflictError         409: not in this state; read what stands in the way
        │   └── OutcomeUnknownError   it was cut off in its middle: look before repeating
        ├── TooManyError          429: after `retry_after_s`
        └── FailedError           5xx: the station failed at it
"""

import json
from dataclasses import dataclass
from typing import Any

import httpx

OUTCOME_HEADER = "Idempotency-Outcome"


@dataclass(frozen=True, slots=True)
class Field:
    """What is wrong with one field."""

    path: tuple[str | int, ...]
    """From the top of the body or the query, such as ``("config", "max_depth_m")``."""
    message: str
    """With the limit that it breaks."""

    def __str__(self) -> str:
        """Return path and message in one line."""
        return f"{'.'.join(map(str, self.path))}: {self.message}"


class StationError(Exception):
    """Parent of everything that this package raises."""


class UnreachableError(StationError):
    """The station did not answer, however often it was asked."""


class VersionError(StationError):
    """Client and station are of different versions that do not understand each other."""


class NotSentError(StationError):
    """The call would have sent a robot something, and the client may not send."""


class JobFailedError(StationError):
    """A job ended without what it was begun for."""

    def __init__(self, job: Any) -> None:  # noqa: ANN401 - a generated model
        super().__init__(f"{job.id} ({job.kind}) is {job.state}: {job.message}")
        self.job = job


class ProblemError(StationError):
    """The station refused a request, or failed at it."""

    def __init__(self, status: int, detail: str, fields: tuple[Field, ...], where: str) -> None:
        lines = [detail, *(f"  {field}" for field in fields)]
        super().__init__(f"{where}: " + "\n".join(lines))
        self.status = status
        self.detail = detail
        """One sentence that says what to do."""
        self.fields = fields
        """Fields that are wrong, or what stands in the way, each by its path."""
        self.retry_after_s: float | None = None
        self.location: str | None = None
        """Where to look, if the station knows."""


class InvalidError(ProblemError):
    """Fields are wrong; nothing was changed."""


class UnknownError(ProblemError):
    """There is no such thing."""


class NotAllowedError(ProblemError):
    """The token may not do this."""


class ConflictError(ProblemError):
    """The thing is not in a state that allows this."""


class OutcomeUnknownError(ConflictError):
    """The request was cut off in its middle, and the station cannot say what came of it."""


class TooManyError(ProblemError):
    """The token asks too much, and went on doing so."""


class FailedError(ProblemError):
    """The station failed."""


_BY_STATUS: dict[int, type[ProblemError]] = {
    401: NotAllowedError,
    403: NotAllowedError,
    404: UnknownError,
    409: ConflictError,
    422: InvalidError,
    429: TooManyError,
}


def retry_after_s(answer: httpx.Response) -> float | None:
    """Return how long a station wants to be left alone, s; ``None`` if it does not say."""
    told = answer.headers.get("Retry-After", "")
    return float(told) if told.isascii() and told.isdecimal() else None


def problem_of(answer: httpx.Response) -> ProblemError:
    """Return the exception that an answer stands for."""
    try:
        document: dict[str, Any] = answer.json()
    except (json.JSONDecodeError, UnicodeDecodeError):
        document = {}
    kind = FailedError if answer.status_code >= 500 else ProblemError
    kind = _BY_STATUS.get(answer.status_code, kind)
    if answer.headers.get(OUTCOME_HEADER) == "unknown":
        kind = OutcomeUnknownError
    fields = tuple(
        Field(tuple(one["loc"]), str(one["msg"])) for one in document.get("errors") or ()
    )
    request = answer.request
    error = kind(
        answer.status_code,
        str(document.get("detail") or answer.reason_phrase),
        fields,
        f"{request.method} {request.url.path} ({answer.status_code})",
    )
    error.retry_after_s = retry_after_s(answer)
    error.location = answer.headers.get("Location")
    return error
