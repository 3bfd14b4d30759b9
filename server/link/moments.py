"""Moments on which a script plans: surfaced, contact, dive begun, dive ended.

Each is a row of the event log, told once whichever link brought it: by the time of the robot's own
word, a late one says nothing new. ``at`` is when the station knew; ``measured_at`` and
``received_at`` are in the data.

A robot that is heard by satellite alone is heard at the surface alone; that it dived between two
calls is told by the leg that it flies.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any, Final

from sqlalchemy.orm import Session

from db.query.station.events import EventRecord, add_event, newest_of_kinds
from robot_link.messages import LinkState, OnboardPlanState, PlanReport, RobotMode, StateReport
from server.base.foundation import Foundation
from server.base.retry_queue import RetryQueue
from server.fleet.fleet import Fleet
from server.fleet.status import SURFACE_DEPTH_M, UNDER_WATER
from server.fleet.words import carrier_title
from server.link.event import PlanReported, StateReported

SURFACED: Final = "robot.surfaced"
CONTACT: Final = "robot.contact"
DIVE_BEGUN: Final = "robot.dive_begun"
DIVE_ENDED: Final = "robot.dive_ended"
_AT_THE_SURFACE: Final = (
    RobotMode.IDLE,
    RobotMode.SURFACED,
    RobotMode.TURNING,
    RobotMode.HOLDING,
)
_SILENCE: Final = timedelta(seconds=10)
"""Of a radio, by the robots' clock, after which to be heard again is a contact."""
_CAUSES: Final[Mapping[LinkState, str]] = MappingProxyType(
    {
        LinkState.SUBMERGED: "it was under water",
        LinkState.DISABLED: "its link was unplugged",
        LinkState.PORT_CLOSED: "the station's radio could not be opened",
        LinkState.MUTE: "the station's radio did not answer",
    }
)
"""Why a radio did not hear a robot, as far as its last state tells."""
_ONE_CALL: Final = timedelta(minutes=5)
"""Sessions by satellite that follow each other within this are one contact."""


@dataclass(frozen=True, slots=True)
class Told:
    """What was told of one robot, or was known when nothing was to be told."""

    is_down: bool | None = None
    """Whether it is in a dive; ``None`` before anything is known."""
    at: datetime | None = None
    """Time of the newest word that said so."""
    flown: tuple[str | None, int] = (None, 0)
    """Plan on board and its leg, as of the newest word on that."""
    is_live: bool = False
    """Whether a radio hears it."""
    silent_since: datetime | None = None
    """Since when none does, after a restart the newest word of before; ``None`` before any."""
    silence: LinkState | None = None
    """State of its radio while none hears it."""
    called_at: datetime | None = None
    """Newest session by satellite, after a restart the newest word of before."""


class Moments:
    """Writes them down as they are known. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._fleet = fleet
        self._told: dict[str, Told] = {}
        self._queue = RetryQueue("moments of robots")

    async def load(self) -> None:
        """Go on from what was told last, and tell what a station that was killed had not told."""
        kinds = (DIVE_BEGUN, DIVE_ENDED)
        for status in self._fleet.statuses:
            robot, state = status.record.id, status.state
            last = await self._store.query(
                lambda session, robot=robot: newest_of_kinds(session, robot, kinds)
            )
            heard_at = None if state is None else state.received_at
            self._told[robot] = replace(_resumed(last), silent_since=heard_at, called_at=heard_at)
            if state is not None and not status.record.is_foreign:
                self._take(state, by=None)

    async def run(self) -> None:
        """Write until cancelled."""
        await self._queue.run()

    def take_state(self, event: StateReported) -> None:
        """Take a state; one that is older than what is known says nothing new."""
        self._take(event.report, by="radio" if event.is_prompt else "satellite")

    def _take(self, report: StateReport, *, by: str | None) -> None:
        told, down = self._of(report.robot), is_down(report)
        if down is None or (told.at is not None and report.measured_at <= told.at):
            return
        self._told[report.robot] = replace(told, is_down=down, at=report.measured_at)
        if down == told.is_down or (told.is_down is None and not down):
            return
        self._dive(report, is_begun=down, by=by)

    def take_plan(self, event: PlanReported) -> None:
        """Take how far a robot is with its plan: by satellite that may tell of a dive."""
        report = event.report
        told, flown = self._of(report.robot), _flown(report)
        self._told[report.robot] = replace(told, flown=flown)
        state = self._fleet.status(report.robot).state
        is_further = flown[0] == told.flown[0] and flown[1] > told.flown[1]
        if event.is_prompt or not is_further or told.is_down or state is None:
            return
        if told.at is None or report.measured_at < told.at:
            return
        self._dive(state, is_begun=False, by="satellite")

    def robot_changed(self, robot: str) -> None:
        """Take that a link to a robot may be another: it may have come into contact."""
        if not self._fleet.knows(robot):
            return
        status, told, now = self._fleet.status(robot), self._of(robot), self._clock.now()
        is_live = status.radio_state is LinkState.LIVE
        if not is_live:
            told = self._told[robot] = replace(told, silence=status.radio_state)
        if is_live != told.is_live:
            since = told.silent_since
            self._told[robot] = replace(
                told, is_live=is_live, silent_since=None if is_live else now
            )
            if is_live and (since is None or now - since >= _SILENCE):
                carrier = "" if status.radio is None else status.radio.carrier
                self._contact(robot, carrier, now, now, told)
            return
        link = status.satellite_link
        called_at = None if link is None else link.heard_at
        if called_at is None or link is None or called_at == told.called_at:
            return
        self._told[robot] = replace(told, called_at=called_at)
        is_new = told.called_at is None or called_at - told.called_at >= _ONE_CALL
        if is_new and not is_live:
            self._contact(robot, link.carrier, called_at, now)

    def _of(self, robot: str) -> Told:
        return self._told.setdefault(robot, Told())

    def _dive(self, report: StateReport, *, is_begun: bool, by: str | None) -> None:
        """Write that a dive began, or that it ended and the robot is up.

        ``by`` is ``None`` for a word of before a restart, which tells no more what carried it.
        """
        robot, status = report.robot, self._fleet.status(report.robot)
        hand, plan = status.plan, status.plan_report
        data = {
            "measured_at": report.measured_at.isoformat(),
            "received_at": report.received_at.isoformat(),
            "by": by,
            "position_ned": list(report.position_ned),
            "position_std_m": report.position_std_m,
            "has_fix": report.has_fix,
            "plan": None if hand is None or hand.state != "running" else hand.plan_id,
            "leg": None if plan is None else plan.leg,
        }
        told = (
            [(DIVE_BEGUN, f"{robot} began a dive.")]
            if is_begun
            else [
                (DIVE_ENDED, f"{robot} ended its dive."),
                (SURFACED, f"{robot} is at the surface."),
            ]
        )
        at = self._clock.now()
        self._queue.add(lambda: self._write(robot, told, data, at))

    def _contact(
        self,
        robot: str,
        carrier: str,
        said_at: datetime,
        now: datetime,
        lost: Told | None = None,
    ) -> None:
        """Write that a robot is heard again; of a radio also how long it was not, and why."""
        data: dict[str, object] = {
            "measured_at": said_at.isoformat(),
            "received_at": now.isoformat(),
            "carrier": carrier,
        }
        text = f"{robot} is heard again by {carrier_title(carrier)}"
        if lost is not None and lost.silent_since is not None:
            silent_s = round((now - lost.silent_since).total_seconds())
            cause = None if lost.silence is None else _CAUSES.get(lost.silence)
            data |= {
                "silent_since": lost.silent_since.isoformat(),
                "silent_s": silent_s,
                "cause": cause,
            }
            text += f" after {_lasted(silent_s)}; {cause or 'why it was not is not known'}"
        self._queue.add(lambda: self._write(robot, [(CONTACT, f"{text}.")], data, now))

    async def _write(
        self, robot: str, told: list[tuple[str, str]], data: Mapping[str, Any], at: datetime
    ) -> None:
        def write(session: Session) -> None:
            for kind, text in told:
                add_event(session, at, kind, text, robot=robot, data=data)

        await self._store.write(write)


def is_down(report: StateReport) -> bool | None:
    """Tell whether a robot says that it is in a dive; ``None`` where its word leaves that open.

    It announces a dive before the antenna goes under. One that swims, follows a target or comes up
    near the surface may be on its way either way.
    """
    is_deep = report.position_ned[2] > SURFACE_DEPTH_M
    if report.mode in UNDER_WATER or is_deep:
        return True
    return False if report.mode in _AT_THE_SURFACE else None


def _lasted(seconds: int) -> str:
    """Return a duration for a sentence."""
    minutes, rest = divmod(seconds, 60)
    if minutes < 1:
        return f"{rest} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"


def _flown(report: PlanReport) -> tuple[str | None, int]:
    is_done = report.state is OnboardPlanState.DONE
    return report.sha256, report.legs if is_done else report.leg


def _resumed(last: EventRecord | None) -> Told:
    if last is None:
        return Told()
    at = datetime.fromisoformat(last.data["measured_at"])
    return Told(is_down=last.kind == DIVE_BEGUN, at=at)
