"""Who is in charge, in sentences."""

from typing import Final

from db.query.fleet.leases import LeaseRecord
from server.lease.state import Holder

_MINUTE_S: Final = 60.0


def holder_words(lease: LeaseRecord) -> str:
    """Return who is in charge of a robot, without a full stop."""
    if lease.holder is None:
        return f"Nobody is in charge of {lease.robot}"
    return f"{_named(lease.holder, lease.holder_kind)} is in charge of {lease.robot}"


def in_charge(holder: Holder, robot: str, how: str) -> str:
    """Return that somebody is in charge from now on, and how it came to that."""
    who = _named(holder.name, holder.kind)
    return f"{who} is in charge of {robot}{', ' if how else ''}{how}."


def refusal(lease: LeaseRecord, holder: Holder, silent_s: float | None) -> str:
    """Return why somebody cannot send a robot anything, and what to do.

    Args:
        lease: Of the robot, which somebody else holds.
        holder: Who would send it something.
        silent_s: For how long who is in charge has been silent; ``None`` while they are not.
    """
    who = holder_words(lease)
    if lease.holder_kind == "station":
        if holder.kind == "script":
            return f"{who}; a person of this station must take charge first."
        return f"{who}; take charge first."
    if holder.kind == "script":
        if lease.holder_kind == "script":
            return f"{who}; it must release it, or be silent for a while."
        return f"{who}; ask them to let this script act."
    if silent_s is not None:
        return f"{who}, silent for {_for(silent_s)}; take charge first."
    return f"{who}; request it from them first."


def _named(name: str, kind: str | None) -> str:
    """Return a holder at the beginning of a sentence."""
    match kind:
        case "script":
            return f"The script {name}"
        case "station":
            return name.capitalize()
        case _:
            return name


def _for(seconds: float) -> str:
    minutes = round(seconds / _MINUTE_S)
    return f"{seconds:.0f} s" if minutes < 1 else f"{minutes} min"
