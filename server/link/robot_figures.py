"""What the station knows of its robots, in figures."""

from collections.abc import Callable, Iterable, Iterator
from typing import Final

from prometheus_client.core import Metric

from robot_link.messages import LinkState
from server.base.metric.metrics import Row, gauges, totals
from server.fleet.fleet import Fleet
from server.fleet.link_panel import link_views
from server.fleet.link_view import RobotLinkView
from server.fleet.status import RobotStatus

_OF_LINK: Final = ("robot", "link")
_RobotValue = Callable[[RobotStatus], float | None]


def figures_of(fleet: Fleet) -> Iterator[Metric]:
    """Return the figures of every robot that is in service.

    A link is named by its place among the robot's links and by what carries it, such as
    ``1-xbee``. Ages are in seconds of the robots' clock.
    """
    statuses = list(fleet.statuses)
    yield from _of_links(fleet, statuses)
    yield gauges(
        "robot_state_age_seconds",
        "Since the robot measured the newest state that the station has.",
        ("robot",),
        _rows(statuses, lambda one: one.state and fleet.age_s(one.state.measured_at)),
    )
    yield gauges(
        "robot_battery_ratio",
        "Charge of the battery, 0 to 1, as the robot says.",
        ("robot",),
        _rows(statuses, lambda one: one.state and one.state.battery_fraction),
    )
    yield gauges(
        "robot_clock_offset_seconds",
        "By how much the robot's clock is ahead of the station's.",
        ("robot",),
        _rows(statuses, clock_offset_s),
    )
    yield gauges(
        "robot_plan_state",
        "The state of the plan in hand, always 1.",
        ("robot", "state"),
        (((one.record.id, one.plan.state), 1.0) for one in statuses if one.plan is not None),
    )
    yield gauges(
        "satellite_credits_today",
        "Credits that were spent on the robot since 00:00 UTC.",
        ("robot",),
        _rows(statuses, lambda one: one.satellite and one.satellite.credits_today),
    )
    yield gauges(
        "satellite_credits_per_day",
        "Credits that may be spent on the robot in a day.",
        ("robot",),
        _rows(statuses, lambda one: one.satellite and one.satellite.credits_per_day),
    )


def clock_offsets_s(fleet: Fleet) -> dict[str, float]:
    """Return by how much the clock of each robot that is heard now is ahead of the station's."""
    heard = (
        status
        for status in fleet.statuses
        if any(report.state is LinkState.LIVE for report in status.links.values())
    )
    offsets = {status.record.id: clock_offset_s(status) for status in heard}
    return {robot: offset_s for robot, offset_s in offsets.items() if offset_s is not None}


def clock_offset_s(status: RobotStatus) -> float | None:
    """Return by how much a robot's clock is ahead, by its radio; ``None`` if unknown."""
    if status.clock_fault is not None:
        return status.clock_fault.ahead.total_seconds()
    measured = (report.clock_offset_s for report in status.links.values())
    return next((offset_s for offset_s in measured if offset_s is not None), None)


def _of_links(fleet: Fleet, statuses: Iterable[RobotStatus]) -> Iterator[Metric]:
    links = [
        ((status.record.id, f"{number}-{view.carrier}"), view)
        for status in statuses
        for number, view in enumerate(link_views(status), start=1)
    ]
    silent: list[Row] = [
        (labels, fleet.age_s(view.heard_at)) for labels, view in links if view.heard_at is not None
    ]
    text = "Since the last word of the robot on this link, by the robots' clock."
    yield gauges("robot_link_silence_seconds", text, _OF_LINK, silent)
    states = [((*labels, view.state), 1.0) for labels, view in links]
    yield gauges("robot_link_state", "The state of a link, always 1.", (*_OF_LINK, "state"), states)
    frames = [
        ((*labels, result), float(count))
        for labels, view in links
        for result, count in _frames(view)
    ]
    text = "Frames that came by a link since it was opened, good and dropped."
    yield totals("robot_link_frames", text, (*_OF_LINK, "result"), frames)


def _frames(view: RobotLinkView) -> tuple[tuple[str, int], ...]:
    return ("good", view.frames_received), ("bad", view.frames_bad)


def _rows(statuses: Iterable[RobotStatus], value_of: _RobotValue) -> Iterator[Row]:
    for status in statuses:
        value = value_of(status)
        if value is not None:
            yield (status.record.id,), float(value)
