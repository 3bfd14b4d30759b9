"""Other ground stations on the MAVLink side: they see who is in charge, and ask for robots.

The robot passes on what they ask and tells whom it obeys (``robot_link/mavlink/operator_control``).
Who is to be obeyed follows the lease, and is said again while the robot tells otherwise.
"""

import asyncio
from functools import partial
from typing import Final

from sqlalchemy.orm import Session

from db.query.fleet.leases import LeaseRecord, get_lease, list_leases
from robot_link.clock import monotonic_s, set_or_after
from robot_link.mavlink.codec import STATION_SYSTEM
from robot_link.mavlink.operator_control import NOBODY
from robot_link.messages import RobotId, SystemId
from robot_link.report import ControlAsked, ControlReport
from robot_link.transport.opening import is_radio
from server.base.foundation import Foundation
from server.base.retry_queue import RetryQueue
from server.fleet.fleet import Fleet
from server.lease.leases import Leases
from server.lease.state import Holder, LeaseChanged, LeaseEvidence, apply
from server.lease.words import in_charge
from server.link.event import ControlReported, ControlRequested
from server.link.radios import Radios

_TAKES_S: Final = 20.0
"""A robot that does not obey whom it was given to after so long does not do so."""
QUIET_S: Final = 10.0
"""For so long after a request ended, further ones of a robot are refused without a word."""


class GroundStations:
    """Belongs to one event loop; what it says of leases is what was committed."""

    def __init__(
        self, foundation: Foundation, leases: Leases, radios: Radios, fleet: Fleet
    ) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._feed = foundation.feed
        self._leases = leases
        self._radios = radios
        self._fleet = fleet
        self._told: dict[RobotId, ControlReport] = {}
        self._obeyed: set[RobotId] = set()
        """Robots that said that they obey the other ground station that is in charge."""
        self._given_s: dict[RobotId, float] = {}
        """When each robot went to another ground station."""
        self._asking: dict[RobotId, int] = {}
        """Who asks for each robot."""
        self._ends_s: dict[RobotId, float] = {}
        """When what one asks is refused by itself."""
        self._quiet_s: dict[RobotId, float] = {}
        self._work = RetryQueue("words on who controls robots")
        self._stirred = asyncio.Event()

    def take_report(self, event: ControlReported) -> None:
        """Take what a robot says of whom it obeys."""
        report, before = event.report, self._told.get(event.report.robot)
        self._told[report.robot] = report
        if before is None or before.system != report.system:
            self._feed.mark("leases")
        self._work.add(partial(self._compare, report.robot))

    def take_request(self, event: ControlRequested) -> None:
        """Take what another ground station asks."""
        self._work.add(partial(self._asked, event.asked))

    def take_lease(self, event: LeaseChanged) -> None:
        """Take that a lease moved: the robot is told, and who asked gets an answer."""
        lease, robot = event.lease, RobotId(event.lease.robot)
        asked = self._asking.pop(robot, None)
        if lease.requested_system is not None:
            self._asking[robot] = lease.requested_system
        if asked is not None and lease.requested_system is None:
            self._ends_s.pop(robot, None)
            self._quiet_s[robot] = monotonic_s() + QUIET_S
            if lease.holder_system != asked:
                self._radios.answer_control(robot, SystemId(asked), is_heard=False)
        if event.has_other_holder:
            self._obeyed.discard(robot)
            self._given_s[robot] = monotonic_s()
            self._work.add(partial(self._give, robot))

    def settings_changed(self) -> None:
        """Take that other ground stations may take robots, or may not any more."""
        for robot in self._told:
            self._work.add(partial(self._compare, robot))

    def by_radio(self, robot: str) -> str:
        """Return whom a robot obeys by its last word, a sentence; "" for one without a radio."""
        if not any(is_radio(uri) for uri in self._fleet.status(robot).record.links):
            return ""
        report = self._told.get(RobotId(robot))
        if report is None:
            return (
                f"{robot} has not told by radio whom it obeys: other ground stations do not see"
                " who is in charge."
            )
        if report.system == NOBODY:
            return f"By its last word by radio, {robot} obeys nobody."
        if report.system == STATION_SYSTEM:
            return f"By its last word by radio, {robot} obeys this station."
        return f"By its last word by radio, {robot} obeys ground station {report.system}."

    def ends_in_s(self, lease: LeaseRecord) -> float | None:
        """Return when what another ground station asks is refused by itself, s of the wall."""
        if lease.requested_system is None:
            return None
        return max(0.0, self._ends_s.get(RobotId(lease.robot), 0.0) - monotonic_s())

    async def run(self) -> None:
        """Decide and tell, and refuse what nobody answers, until cancelled.

        What was asked of the station that ran before is refused: its robot has given up waiting.
        Whom that gave a robot is in charge only if the robot says so.
        """
        for lease in await self._store.query(list_leases):
            if lease.holder_system is not None:
                self._obeyed.add(RobotId(lease.robot))
            if lease.requested_system is not None:
                self._asking[RobotId(lease.robot)] = lease.requested_system
                self._work.add(partial(self._expire, RobotId(lease.robot)))
        async with asyncio.TaskGroup() as group:
            group.create_task(self._work.run(), name="other ground stations")
            group.create_task(self._end_requests(), name="requests of other ground stations")

    async def _end_requests(self) -> None:
        while True:
            self._stirred.clear()
            now_s = monotonic_s()
            for robot, end_s in list(self._ends_s.items()):
                if end_s <= now_s:
                    del self._ends_s[robot]
                    self._work.add(partial(self._expire, robot))
            nearest_s = min(self._ends_s.values(), default=None)
            await set_or_after(self._stirred, None if nearest_s is None else nearest_s - now_s)

    async def _compare(self, robot: RobotId) -> None:
        """Hold the robot's word against the lease: tell it again, or take that it left."""
        report = self._told[robot]
        if not self._is_ours(robot) or report.system == NOBODY:
            return
        lease = self._leases.of(robot)
        if lease.holder_system is None:
            allows = await self._allows(lease)
            if report.system != STATION_SYSTEM or report.is_takeover_allowed != allows:
                await self._give(robot)
        elif report.system == lease.holder_system:
            self._obeyed.add(robot)
        elif robot in self._obeyed or self._was_given_s_ago(robot) > _TAKES_S:
            await self._left(robot, lease.holder_system)
        else:
            await self._give(robot)

    async def _give(self, robot: RobotId) -> None:
        if not self._is_ours(robot):
            return
        lease = self._leases.of(robot)
        system = STATION_SYSTEM if lease.holder_system is None else SystemId(lease.holder_system)
        self._radios.give_control(robot, system, allows_takeover=await self._allows(lease))

    async def _asked(self, asked: ControlAsked) -> None:
        robot = asked.robot
        if not self._is_ours(robot):
            return
        if not asked.is_request:
            await self._end(robot, asked.system, LeaseEvidence.WITHDRAWN, "asks for it no more")
            await self._left(robot, asked.system)
            return
        allows = await self._allows(self._leases.of(robot))
        is_quiet = monotonic_s() < self._quiet_s.get(robot, 0.0)
        lease = await self._store.write(
            lambda session: self._requested(session, asked, allows=allows, is_quiet=is_quiet)
        )
        if lease.holder_system == asked.system:
            await self._give(robot)
            return
        is_heard = lease.requested_system == asked.system
        if is_heard and robot not in self._ends_s:
            self._ends_s[robot] = monotonic_s() + asked.stands_s
            self._stirred.set()
        self._radios.answer_control(robot, asked.system, is_heard=is_heard)

    def _requested(
        self, session: Session, asked: ControlAsked, *, allows: bool, is_quiet: bool
    ) -> LeaseRecord:
        """Have a request stand, or be granted where nobody needs to be asked; return the lease."""
        robot, station = asked.robot, Holder.station(asked.system)
        before = get_lease(session, robot)
        evidence, text = None, ""
        if is_quiet or before.state == "requested" or before.holder_system is not None:
            return before
        if before.holder_kind == "person":
            evidence = LeaseEvidence.REQUESTED
            text = f"{station.name.capitalize()} asks {before.holder} for {robot} by radio."
        elif allows:
            is_free = before.holder is None
            evidence = LeaseEvidence.TAKEN if is_free else LeaseEvidence.TAKEN_OVER
            text = in_charge(station, robot, "as it asked by radio")
        if evidence is not None:
            apply(session, robot, evidence, text, self._clock.now(), to=station)
        return get_lease(session, robot)

    async def _expire(self, robot: RobotId) -> None:
        system = self._leases.of(robot).requested_system
        if system is not None:
            why = "asked for it; nobody answered in time, so it was not given"
            await self._end(robot, SystemId(system), LeaseEvidence.EXPIRED, why)

    async def _end(
        self, robot: RobotId, system: SystemId, evidence: LeaseEvidence, why: str
    ) -> None:
        """End what a ground station asks, unless that was answered just now."""

        def write(session: Session) -> None:
            if get_lease(session, robot).requested_system == system:
                text = f"{robot}: ground station {system} {why}."
                apply(session, robot, evidence, text, self._clock.now())

        await self._store.write(write)

    async def _left(self, robot: RobotId, system: int) -> None:
        """Free a robot that does not obey another ground station any more, by its own word.

        Nothing is changed if somebody else is in charge meanwhile.
        """

        def write(session: Session) -> None:
            if get_lease(session, robot).holder_system == system:
                text = (
                    f"{robot} does not obey ground station {system} any more, by its own word;"
                    " nobody is in charge of it."
                )
                apply(session, robot, LeaseEvidence.RELEASED, text, self._clock.now())

        await self._store.write(write)

    async def _allows(self, lease: LeaseRecord) -> bool:
        """Tell whether another ground station that asks gets a robot without anybody's word."""
        limits = await self._leases.limits(lease.robot)
        return limits.other_stations and lease.holder_kind not in {"person", "station"}

    def _was_given_s_ago(self, robot: RobotId) -> float:
        return monotonic_s() - self._given_s.setdefault(robot, monotonic_s())

    def _is_ours(self, robot: RobotId) -> bool:
        """Tell whether a robot takes its station's word on who is in control of it."""
        return self._fleet.knows(robot) and not self._fleet.status(robot).record.is_foreign
