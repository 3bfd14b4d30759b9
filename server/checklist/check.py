"""What automatic items ask of what a robot told: one row of ``CHECKS`` each.

A check that nobody can answer yet is not passed: what is not known is not known to be well.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType
from typing import Final

from robot_link.messages import LinkState
from server.fleet.status import RobotStatus
from server.fleet.view import ChannelView

_HARMLESS: Final = ("info", "watch")


@dataclass(frozen=True, slots=True)
class Situation:
    """All that checks look at, of one robot at one moment."""

    status: RobotStatus
    channels: Mapping[str, ChannelView]
    """Newest value of each channel that it told."""
    alarms: Sequence[tuple[str, str]]
    """Level and text of each alarm of it that stands."""
    now: datetime
    speed: float
    """Seconds of the robots' clock per second of the wall: limits of age are wall time."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What a check found."""

    is_passed: bool
    text: str
    """The value with its unit, or what is the matter, as a list shows it."""
    at: datetime | None = None
    """When that was measured or told; None where it is the station's own word, of now."""


@dataclass(frozen=True, slots=True)
class Limit:
    """The number that a check is held against."""

    title: str
    unit: str
    usual: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that an automatic item can ask."""

    key: str
    title: str
    help: str
    judge: Callable[[Situation, float], Finding]
    limit: Limit | None = None
    channel: str = ""
    """The channel that it is about, whose value of yesterday is shown beside it."""
    holds_in_flight: bool = True
    """Whether it means anything of a robot that flies a plan already: one under water has no link
    and no fix, and nobody minds."""


def judged(check: Check, situation: Situation, limit: float | None) -> Finding:
    """Return what a check finds, with the usual limit where none is given."""
    usual = math.nan if check.limit is None else check.limit.usual
    return check.judge(situation, usual if limit is None else limit)


def _unknown(what: str) -> Finding:
    return Finding(is_passed=False, text=f"{what} is not told yet")


def _battery(one: Situation, limit: float) -> Finding:
    told = one.channels.get("battery_fraction")
    if told is None:
        return _unknown("The charge")
    return Finding(100.0 * told.value >= limit, f"{100.0 * told.value:.0f} %", told.measured_at)


def _leak(one: Situation, limit: float) -> Finding:
    del limit
    told = one.channels.get("leak")
    if told is None:
        return _unknown("The leak sensor")
    is_dry = told.value < 0.5
    return Finding(is_dry, "dry" if is_dry else "water in the hull", told.measured_at)


def _internal_pressure(one: Situation, limit: float) -> Finding:
    told = one.channels.get("internal_pressure")
    if told is None:
        return _unknown("The pressure in the hull")
    return Finding(told.value <= limit, f"{told.value:.0f} hPa", told.measured_at)


def _depth_zero(one: Situation, limit: float) -> Finding:
    told = one.channels.get("depth_m")
    if told is None:
        return _unknown("The depth")
    return Finding(abs(told.value) <= limit, f"{told.value:.2f} m", told.measured_at)


def _state_age(one: Situation, limit: float) -> Finding:
    at = one.status.heard_at if one.status.state is None else one.status.state.measured_at
    if at is None:
        return Finding(is_passed=False, text="never heard")
    age_s = max(0.0, (one.now - at).total_seconds()) / max(1.0, one.speed)
    return Finding(age_s <= limit, f"{age_s:.0f} s old", at)


def _link(one: Situation, limit: float) -> Finding:
    del limit
    link = one.status.link
    if link is None or link.state is LinkState.NEVER_HEARD:
        return Finding(is_passed=False, text="never heard")
    is_live = link.state is LinkState.LIVE
    words = f"{link.carrier or 'link'} {link.state.name.lower().replace('_', ' ')}"
    return Finding(is_live, words, link.heard_at)


def _position(one: Situation, limit: float) -> Finding:
    state = one.status.state
    if one.status.record.site.kind == "tank":
        return Finding(is_passed=True, text="no GPS in a tank: positions are of the tank's frame")
    if state is None:
        return _unknown("The position")
    if not state.has_fix:
        return Finding(is_passed=False, text="no fix", at=state.measured_at)
    std_m = state.position_std_m
    return Finding(std_m <= limit, f"fix, {std_m:.1f} m", state.measured_at)


def _free_disk(one: Situation, limit: float) -> Finding:
    told = one.channels.get("free_disk")
    if told is None:
        return _unknown("The free disk")
    return Finding(told.value >= limit, f"{told.value:,.0f} MB", told.measured_at)


def _channels(one: Situation, limit: float) -> Finding:
    del limit
    announced, faults = one.status.announced, one.status.channel_faults
    if announced is None:
        return _unknown("The table of channels")
    if faults:
        return Finding(is_passed=False, text=next(iter(faults.values())))
    return Finding(is_passed=True, text="announced, as the catalogue has them")


def _plan_on_board(one: Situation, limit: float) -> Finding:
    del limit
    hand, report = one.status.plan, one.status.plan_report
    if hand is None or report is None:
        return Finding(is_passed=False, text="no plan is proved on board")
    is_proved = hand.record.sha256 is not None and hand.record.sha256 == report.sha256
    words = "its hash was echoed" if is_proved else "the robot named no such hash"
    return Finding(is_proved, f"{hand.plan_id}: {words}", report.measured_at)


def _doubt(one: Situation, limit: float) -> Finding:
    report = one.status.current_report
    if report is None:
        return _unknown("The estimator's doubt")
    return Finding(report.doubt <= limit, f"{report.doubt:.1f} times", report.measured_at)


def _current(one: Situation, limit: float) -> Finding:
    report = one.status.current_report
    if report is None:
        return _unknown("The believed current")
    return Finding(
        report.current_std_m_s <= limit,
        f"known to {report.current_std_m_s:.2f} m/s",
        report.measured_at,
    )


def _clock(one: Situation, limit: float) -> Finding:
    del limit
    fault = one.status.clock_fault
    return Finding(fault is None, "right" if fault is None else fault.text)


def _alarms(one: Situation, limit: float) -> Finding:
    del limit
    grave = [text for level, text in one.alarms if level not in _HARMLESS]
    return Finding(not grave, grave[0] if grave else "none stands")


CHECKS: Final[Mapping[str, Check]] = MappingProxyType(
    {
        check.key: check
        for check in (
            Check(
                "battery",
                "Battery",
                "The charge that the robot reports is at least the limit.",
                _battery,
                Limit("At least", "%", 30.0, 0.0, 100.0),
                channel="battery_fraction",
            ),
            Check(
                "leak", "Leak", "The leak sensor is dry.", _leak, channel="leak"
            ),
            Check(
                "internal_pressure",
                "Pressure in the hull",
                "At most the limit: a hull that was evacuated holds its vacuum.",
                _internal_pressure,
                Limit("At most", "hPa", 1050.0, 100.0, 3000.0),
                channel="internal_pressure",
            ),
            Check(
                "depth_zero",
                "Depth zero",
                "The depth that the robot reports at the surface is within the limit of 0 m.",
                _depth_zero,
                Limit("Within", "m", 0.05, 0.01, 5.0),
                channel="depth_m",
                holds_in_flight=False,
            ),
            Check(
                "state_age",
                "Age of its state",
                "The newest report is not older than the limit, by the wall.",
                _state_age,
                Limit("At most", "s", 10.0, 1.0, 86_400.0),
                holds_in_flight=False,
            ),
            Check(
                "link",
                "Link",
                "The best link to the robot is live.",
                _link,
                holds_in_flight=False,
            ),
            Check(
                "position",
                "Position",
                "The robot has a fix as good as the limit; in a tank, whose frame is its own, none"
                " is wanted.",
                _position,
                Limit("Within", "m", 10.0, 0.1, 1000.0),
                holds_in_flight=False,
            ),
            Check(
                "free_disk",
                "Free disk",
                "The robot's computer has at least this much room.",
                _free_disk,
                Limit("At least", "MB", 200.0, 0.0, 1e9),
                channel="free_disk",
            ),
            Check(
                "channels",
                "Channels",
                "The robot announced what it measures, and that fits the catalogue.",
                _channels,
            ),
            Check(
                "plan_on_board",
                "Plan on board",
                "The robot echoed the hash of the plan that the station shows.",
                _plan_on_board,
            ),
            Check(
                "doubt",
                "Estimator's doubt",
                "How many times larger than its filter's own the robot states its uncertainties is"
                " at most the limit.",
                _doubt,
                Limit("At most", "times", 3.0, 1.0, 100.0),
            ),
            Check(
                "current",
                "Believed current",
                "The robot knows the current as well as the limit: it was told of it, or learned"
                " it.",
                _current,
                Limit("Within", "m/s", 0.10, 0.001, 5.0),
            ),
            Check("clock", "Clock", "The robot's clock is right.", _clock),
            Check(
                "alarms",
                "Alarms",
                "No alarm graver than a watch stands against the robot.",
                _alarms,
            ),
        )
    }
)  # fmt: skip
"""Every check by its key."""
