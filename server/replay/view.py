"""A robot at a moment, and the time that a replay runs over."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from autonomy.channel import ALARM_LEVELS
from robot_link.messages import RobotMode
from server.base.view import View, name_of, one_of
from server.fix.view import FixView
from server.fleet.view import ChannelView, DeploymentBriefView, PositionView

ClockName = Annotated[str, one_of("measured", "received")]


@dataclass(frozen=True, slots=True)
class PlanThenView(View):
    """The plan that was proved to be on board."""

    id: str
    state: Annotated[str, one_of("on_board", "running")]
    """As it was then."""
    leg: int | None
    """Leg that the robot flew, by what the station had heard."""


@dataclass(frozen=True, slots=True)
class AlarmThenView(View):
    """An alarm that stood at a moment: raised, and not normal again."""

    id: str
    level: Annotated[str, one_of(*ALARM_LEVELS)]
    """The gravest that it had."""
    robot: str | None
    """``null`` of the station's own."""
    text: str
    action: str
    raised_at: datetime
    is_acknowledged: bool
    """Whether somebody had seen it by then."""


@dataclass(frozen=True, slots=True)
class MapThenView(View):
    """A field map that had been kept last."""

    variable: str
    model: str
    kept_at: datetime


@dataclass(frozen=True, slots=True)
class BesideView(View):
    """What lies next to a moment; ``null`` where nothing does."""

    sample_before: datetime | None
    """When the robot had measured last before."""
    sample_after: datetime | None
    """When it measured next; far off inside a gap."""
    event_before: datetime | None
    event_after: datetime | None
    """Events of the log book's kinds, of the robot and of the station."""


@dataclass(frozen=True, slots=True)
class RobotThenView(View):
    """Everything that was known of a robot at a moment; ages are against the moment."""

    robot: str
    at: datetime
    clock: ClockName
    """``measured``: what happened, also what was told later. ``received``: what the station had
    heard by then. Of a recording, which nobody heard, always ``measured``."""
    deployment: DeploymentBriefView | None
    """``null`` in the workshop."""
    channels: dict[str, ChannelView]
    untold: list[str]
    """Channels that are left out because it is not kept when their values arrived."""
    position: PositionView | None
    fix: FixView | None
    """Where cameras had found it last; ``null`` where they never did."""
    mode: Annotated[str, name_of(RobotMode)] | None
    """What it was doing; ``null`` where it never said."""
    mode_at: datetime | None
    plan: PlanThenView | None
    alarms: list[AlarmThenView]
    """The gravest first."""
    maps: list[MapThenView]
    beside: BesideView


@dataclass(frozen=True, slots=True)
class MarkView(View):
    """Something on the line of time that a replay can go to."""

    at: datetime
    kind: str
    level: Annotated[str, one_of(*ALARM_LEVELS)]
    text: str


@dataclass(frozen=True, slots=True)
class TimelineView(View):
    """The time around a moment that belongs together: its deployment, else the days around it."""

    robot: str
    deployment: DeploymentBriefView | None
    begins_at: datetime
    ends_at: datetime
    """Now, while it lasts."""
    lasts: bool
    """Whether it goes on."""
    marks: list[MarkView]
    """What the log book tells of it, the oldest first."""
    is_cut: bool
    """Whether there were more marks than are told; the newest are."""
    pruned: list[str]
    """What of that time is no longer all there, sentences."""
