"""When a message of one part is said again: the sky loses some, and not every gateway says which.

A robot speaks before it fetches, so its answer to what it fetched comes with its next call.
"""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any, Final

_ONE_SURFACING: Final = timedelta(minutes=5)
"""Sessions that are nearer to each other belong to one surfacing."""
_SURFACINGS: Final = 2
"""So many without an answer mean that it was lost."""


def not_sent() -> dict[str, Any]:
    """Return the part of a row's document that counts what was sent."""
    return {"sends": 0, "sent_surfacing": None, "surfacings": 0, "surfaced_at": None}


def is_due(document: Mapping[str, Any]) -> bool:
    """Tell whether it is to be sent now: once, and again after surfacings without an answer."""
    if not document["sends"]:
        return True
    return document["surfacings"] - document["sent_surfacing"] >= _SURFACINGS


def sent(document: Mapping[str, Any]) -> dict[str, Any]:
    """Note that a gateway took it."""
    return {
        **document,
        "sends": document["sends"] + 1,
        "sent_surfacing": document["surfacings"],
    }


def lost(document: Mapping[str, Any]) -> dict[str, Any]:
    """Note that what the gateway took is gone, so that it is due again."""
    return {**document, "sent_surfacing": document["surfacings"] - _SURFACINGS}


def surfaced(document: Mapping[str, Any], at: datetime) -> dict[str, Any]:
    """Note a session of the robot."""
    last = document["surfaced_at"]
    if last is not None and at - datetime.fromisoformat(last) < _ONE_SURFACING:
        return {**document}
    return {
        **document,
        "surfacings": document["surfacings"] + 1,
        "surfaced_at": at.isoformat(),
    }
