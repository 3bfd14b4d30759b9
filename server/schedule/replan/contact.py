"""The contact window's clock: since when a robot is up, when it dives, when it is up again.

Every moment is reckoned from a word of the robot and named with its source: the plan that it says
to fly and the dry run of that, parameters as it told them, or the program on board as it is built.
Where it said nothing, nothing is claimed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from db.query.fleet.onboard import ParameterRecord
from onboard.profile import FlightProfile
from robot_link.messages import LinkState, RobotMode
from server.fleet.status import FOLLOW_TARGET, RobotStatus
from server.fleet.words import carrier_title, clock_time
from server.link.moments import is_down
from server.schedule.replan.view import ContactWindowView, MomentView

_BUILT = "as the program on board is built"


@dataclass(frozen=True, slots=True)
class Facts:
    """What a window is reckoned from."""

    status: RobotStatus
    up_since: datetime | None
    """When it came up, by its own word; ``None`` where it dived since, or never said."""
    turn_time_s: float
    """How long preparing a dive takes, as planned; s of the robots' clock."""
    profile: FlightProfile
    parameters: Mapping[str, ParameterRecord]
    """As the robot said them last."""


def contact_of(facts: Facts) -> ContactWindowView:
    """Return how long a robot is expected to be in contact, as far as it has said."""
    status = facts.status
    robot, state = status.record.id, status.state
    link = status.link
    hears = status.radio_state is LinkState.LIVE
    view = ContactWindowView(
        robot=robot,
        state="unknown",
        text=f"{robot} has not said where it is.",
        link=link.carrier if link is not None and link.state is LinkState.LIVE else "",
        heard_at=status.heard_at,
        since=None,
        closes=None,
        earliest=None,
        latest=None,
        opens=_opens(status),
        hears_under_water=hears and status.record.site.radio_under_water,
    )
    if state is None:
        return view
    down = is_down(state)
    if down or (down is None and facts.up_since is None and status.leg_now is not None):
        return _closed(view)
    if status.record.is_foreign:
        text = f"{robot} is up; a vehicle of another maker does not tell when it dives."
        return replace(view, state="open", text=text, since=facts.up_since)
    return _open(replace(view, state="open", since=facts.up_since), facts)


def departure_s(facts: Facts) -> tuple[float, str]:
    """Return how long the robot stays up before the leg that it is about to fly, and who says so.

    The dry run of the plan knows it where there is one; else it is what the planner reckons with.
    """
    hand, leg = facts.status.plan, facts.status.leg_now
    if hand is not None and leg is not None and leg > 0:
        times = (hand.record.document.get("rehearsal") or {}).get("expected_times_s") or ()
        if leg < len(times):
            return times[leg][0] - times[leg - 1][1], f"the dry run of {hand.plan_id}"
    return facts.turn_time_s, "the planner's time at the surface between two dives"


def _closed(view: ContactWindowView) -> ContactWindowView:
    if view.opens is None:
        text = f"{view.robot} is in a dive; it has not said what tells when it comes up."
    else:
        text = f"{view.robot} is in a dive and comes up at about {_time(view.opens.at)}."
    if view.hears_under_water:
        text += " Radio reaches it here under water too; a new plan begins at the surfacing."
    return replace(view, state="closed", text=text)


def _open(view: ContactWindowView, facts: Facts) -> ContactWindowView:
    status, state = facts.status, facts.status.state
    by = f" by {carrier_title(view.link)}" if view.link else ""
    if state is not None and state.mode is RobotMode.HOLDING:
        text = f"{view.robot} holds at the surface{by} until it is told to go on."
        return replace(view, text=text)
    if status.plan is None or status.leg_now is None:
        text = f"{view.robot} lies at the surface{by}; it has said of no plan that it flies one."
        return replace(view, text=text)
    if status.plan.record.kind == FOLLOW_TARGET:
        text = f"{view.robot} is up{by}; following a target, it goes on as soon as it has a fix."
        return replace(view, text=text)
    if state is not None and state.mode is RobotMode.SWIMMING and not status.is_between_dives:
        text = f"{view.robot} swims at the surface{by}, as {status.plan.plan_id} has it."
        return replace(view, text=text)
    if facts.up_since is None:
        text = f"{view.robot} is up{by}; it has not said since when, so that nobody can count down."
        return replace(view, text=text)
    stay_s, stay_by = departure_s(facts)
    least_s, least_by = _parameter(facts, "SURF_MIN_S", facts.profile.surface_min_s)
    most_s, most_by = _parameter(facts, "SURF_MAX_S", facts.profile.surface_max_s)
    closes = _after(facts.up_since, max(stay_s, least_s), stay_by)
    latest = _after(facts.up_since, max(stay_s, most_s), f"{most_by}, after a planned stay")
    text = (
        f"{view.robot} is up{by} and dives again at about {_time(closes.at)}; while its samples "
        f"are not acknowledged it waits, to {_time(latest.at)} at most."
    )
    return replace(
        view,
        text=text,
        closes=closes,
        earliest=_after(facts.up_since, least_s, least_by),
        latest=latest,
        opens=_opens(status, closes.at),
    )


def _opens(status: RobotStatus, dives_at: datetime | None = None) -> MomentView | None:
    """Return when the robot comes up after the dive that it is in, or that begins at a moment."""
    hand, leg = status.plan, status.leg_now
    at = status.next_surfacing()
    if hand is None or leg is None or at is None:
        return None
    source = f"{hand.plan_id} on board"
    if dives_at is None:
        return MomentView(at, source)
    dive_s, ends_s = 0.0, hand.expected_ends_s
    begins = (hand.record.document.get("rehearsal") or {}).get("expected_times_s") or ()
    for number, one in enumerate(hand.legs[leg:], leg):
        known = number < len(begins) and number < len(ends_s)
        dive_s += ends_s[number] - begins[number][0] if known else one.duration_s
        if one.end_ned[2] <= 0.0:
            break
    return MomentView(dives_at + timedelta(seconds=dive_s), source)


def _parameter(facts: Facts, name: str, built: float) -> tuple[float, str]:
    told = facts.parameters.get(name)
    if told is None:
        return built, _BUILT
    return told.value, f"parameter {name}, read at {clock_time(told.read_at)}"


def _after(since: datetime, seconds: float, source: str) -> MomentView:
    return MomentView(since + timedelta(seconds=seconds), source)


def _time(moment: datetime) -> str:
    return moment.strftime("%H:%M:%SZ")
