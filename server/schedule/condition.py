"""What a plan may wait for: a small closed model, no language."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AwareDatetime, Field, TypeAdapter

from autonomy.channel import CHANNELS
from server.base.view import Body
from server.fleet.words import clock_time


class NextSurfacing(Body):
    """The robot's next surfacing."""

    kind: Literal["surfacing"] = "surfacing"
    """At the next surfacing."""


class AtTime(Body):
    """A moment."""

    kind: Literal["time"]
    """At a moment."""
    at: AwareDatetime
    """By the robots' clock."""


class ValueBeyond(Body):
    """A value of the robot that is over or under a limit, while it is not old."""

    kind: Literal["value"]
    """Once a channel is beyond a limit."""
    channel: str
    """Key of a channel as `GET /api/robots/{robot}/state` names it, such as `battery_fraction`."""
    side: Literal["over", "under"]
    """On which side of the limit."""
    limit: Annotated[float, Field(allow_inf_nan=False)]
    """In the channel's unit."""


class AfterPlan(Body):
    """Another plan of the robot is done: a sequence of missions."""

    kind: Literal["after"]
    """After another plan."""
    plan: str
    """Id of the plan that is to be done first."""


Condition = Annotated[NextSurfacing | AtTime | ValueBeyond | AfterPlan, Field(discriminator="kind")]
_ADAPTER: TypeAdapter[Condition] = TypeAdapter(Condition)


def condition_of(document: Mapping[str, Any]) -> Condition:
    """Return a condition as it was written down."""
    return _ADAPTER.validate_python(dict(document))


def document_of(condition: Condition) -> dict[str, Any]:
    """Return a condition to be written down."""
    return condition.model_dump(mode="json")


def text_of(condition: Condition) -> str:
    """Say what is waited for, after "waits for"."""
    match condition:
        case NextSurfacing():
            return "the next surfacing"
        case AtTime(at=at):
            return f"{at.strftime('%Y-%m-%d')} {clock_time(at)}"
        case ValueBeyond(channel=channel, side=side, limit=limit):
            known = CHANNELS.get(channel)
            if known is None:
                return f"{channel} {side} {limit:g}"
            unit = "" if known.unit == "1" else f" {known.unit}"
            return f"{known.title.lower()} {side} {limit:g}{unit}"
        case AfterPlan(plan=plan):
            return f"the end of {plan}"


def moment_of(condition: Condition) -> datetime | None:
    """Return when a condition comes true by the clock alone."""
    return condition.at if isinstance(condition, AtTime) else None
