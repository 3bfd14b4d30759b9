"""A typed client of the Grace Ground Station.

Nothing is sent to a robot unless the client was made with ``may_send=True``::

    from grace_client import Station

    with Station("http://127.0.0.1:8000", token) as station:
        plan = station.plan("mini-1", legs)
        print(plan.account.energy, plan.rehearsal.message)

``AsyncStation`` has the same methods to be awaited. Whatever the station takes is also there by its
own name, as ``station.ask.plans.create_plan(...)``, with models in ``grace_client.models``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from grace_client.event_cursor import AsyncEventCursor, EventCursor
    from grace_client.exchange import Patience
    from grace_client.generated import models
    from grace_client.job import AsyncJob, Job
    from grace_client.problem import (
        ConflictError,
        FailedError,
        InvalidError,
        JobFailedError,
        NotAllowedError,
        NotSentError,
        OutcomeUnknownError,
        ProblemError,
        StationError,
        TooManyError,
        UnknownError,
        UnreachableError,
        VersionError,
    )
    from grace_client.station import AsyncStation, Station

_HOMES: Final = {
    "AsyncEventCursor": "event_cursor",
    "EventCursor": "event_cursor",
    "Patience": "exchange",
    "AsyncJob": "job",
    "Job": "job",
    "AsyncStation": "station",
    "Station": "station",
}
"""Where names are kept, but those of problems; the generator reads none of them."""

__all__ = [
    "AsyncEventCursor",
    "AsyncJob",
    "AsyncStation",
    "ConflictError",
    "EventCursor",
    "FailedError",
    "InvalidError",
    "Job",
    "JobFailedError",
    "NotAllowedError",
    "NotSentError",
    "OutcomeUnknownError",
    "Patience",
    "ProblemError",
    "Station",
    "StationError",
    "TooManyError",
    "UnknownError",
    "UnreachableError",
    "VersionError",
    "models",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever has this name
    """Import a name when it is asked for: the generator runs before the models are there."""
    if name == "models":
        return import_module("grace_client.generated.models")
    if name not in __all__:
        raise AttributeError(name)
    return getattr(import_module(f"grace_client.{_HOMES.get(name, 'problem')}"), name)
