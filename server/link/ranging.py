"""Acoustic ranges: the station's modems ask the robots' modems how far they are, and keep it.

Robots whose links name the same modem at the station share it. Each answer and each silence is a
row; none of it moves a robot on the map by itself.
"""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Protocol

from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query.fleet.robots import RobotRecord
from db.query.measured.ranges import RangeRecord, add_range
from db.record import same
from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.measurement import RangeMeasurement
from robot_link.acoustic.micromodem import MicroModem, modem_of, open_modem
from robot_link.clock import Clock
from robot_link.messages import LinkReport, LinkState, RobotId
from robot_link.station.gateway.address import (
    ACOUSTIC_CARRIER,
    AcousticAddress,
    acoustic_address,
    is_acoustic,
)
from robot_link.transport.datagram import Garbled, PortChanged
from server.base.foundation import Foundation

log = logging.getLogger(__name__)

_STALE_PERIODS = 3.0
"""A robot that did not answer for so many periods is not heard any more."""
_LEAST_PERIOD_S = 1.0
"""Wall seconds; a demo's clock may run fast, sound in its emulated water not so much faster."""


class OpenModem(Protocol):
    """Makes the modem of some links; ``robot_link.acoustic.micromodem.open_modem``."""

    def __call__(self, links: Mapping[RobotId, str], clock: Clock) -> MicroModem:
        """Return the modem; ``run`` opens it."""
        ...


@dataclass(slots=True)
class _Ear:
    """What is known of one robot's acoustic link."""

    robot: RobotId
    uri: str
    address: AcousticAddress
    heard_at: datetime | None = None
    answers: int = 0
    garbled: int = 0


@dataclass(slots=True)
class _Bench:
    """One modem at the station, the links that it serves, and the tasks that work it."""

    modem: MicroModem
    ears: tuple[_Ear, ...]
    opened: asyncio.Event = field(default_factory=asyncio.Event)
    """Set while the modem is there."""
    tasks: list[asyncio.Task[None]] = field(default_factory=list[asyncio.Task[None]])


class Ranging:
    """Runs every acoustic modem of one station. Belongs to one event loop.

    Args:
        foundation: What the station stands on.
        tell: Takes the state of the links.
        open_: Makes a modem; where tests put one of their own.
    """

    def __init__(
        self,
        foundation: Foundation,
        tell: Callable[[LinkReport], None],
        open_: OpenModem = open_modem,
    ) -> None:
        self._store, self._clock = foundation.store, foundation.clock
        self._background = foundation.background
        self._configurations = foundation.configurations
        self._tell = tell
        self._open = open_
        self._benches: list[_Bench] = []
        self._disabled: set[str] = set()
        self._changing = asyncio.Lock()
        """Held while modems are given up and others opened."""

    async def set_robots(self, robots: Iterable[RobotRecord]) -> None:
        """Say which robots there are; modems whose links stay as they were go on undisturbed."""
        wanted = _links_by_modem(robots)
        async with self._changing:
            for bench in list(self._benches):
                links = {ear.robot: ear.uri for ear in bench.ears}
                if links in wanted:
                    wanted.remove(links)
                else:
                    self._benches.remove(bench)
                    await _end(bench)
            for links in wanted:
                self._begin(links)

    def set_enabled(self, uri: str, *, is_enabled: bool) -> None:
        """Enable or disable an acoustic link; links of one modem share that."""
        (self._disabled.discard if is_enabled else self._disabled.add)(uri)
        for bench in self._benches:
            if any(ear.uri == uri for ear in bench.ears):
                bench.modem.set_enabled(is_enabled)
                self._report(bench)

    async def stop(self) -> None:
        """Give every modem up."""
        for bench in self._benches:
            await _end(bench)
        self._benches.clear()

    def _begin(self, links: Mapping[RobotId, str]) -> None:
        try:
            modem = self._open(links, self._clock)
        except ValueError as error:
            log.warning("an acoustic modem is not used: %s", error)
            return
        ears = tuple(_Ear(robot, uri, acoustic_address(uri)) for robot, uri in links.items())
        bench = _Bench(modem, ears)
        if self._disabled & set(links.values()):
            modem.set_enabled(False)
        names = ", ".join(links)
        for name, work in (
            ("acoustic modem", modem.run()),
            ("acoustic events", self._follow(bench)),
            ("acoustic ranges", self._range(bench)),
        ):
            bench.tasks.append(self._background.start(f"{name} of {names}", work))
        self._benches.append(bench)
        self._report(bench)

    async def _follow(self, bench: _Bench) -> None:
        async for event in bench.modem.events():
            match event:
                case PortChanged():
                    (bench.opened.set if event.is_open else bench.opened.clear)()
                case Garbled():
                    for ear in bench.ears:
                        ear.garbled += event.frames
                case _:
                    continue
            self._report(bench)

    async def _range(self, bench: _Bench) -> None:
        """Ask each robot in turn, again and again, while the modem is there."""
        while True:
            await bench.opened.wait()
            for ear in bench.ears:
                if bench.modem.is_ready:
                    await self._measure(bench, ear)
            period_s = bench.modem.config.period_s / self._clock.speed
            await asyncio.sleep(max(period_s, _LEAST_PERIOD_S))

    async def _measure(self, bench: _Bench, ear: _Ear) -> None:
        await self._configure(bench, ear)
        found = await bench.modem.ping(ear.address.peer)
        if found.is_valid:
            ear.heard_at = found.at
            ear.answers += 1
        self._report(bench)
        await self._keep(found)

    async def _configure(self, bench: _Bench, ear: _Ear) -> None:
        """Use what the operator has set by now; while it cannot be read, what held before."""
        with contextlib.suppress(StoreError):
            found = await self._configurations.current("acoustic", ear.robot)
            bench.modem.config = found.value_as(AcousticConfig)

    async def _keep(self, found: RangeMeasurement) -> None:
        record = same(RangeRecord, found)

        def write(session: Session) -> None:
            add_range(session, record)

        try:
            await self._store.write(write)
        except StoreError as error:
            log.warning("a range of %s is not kept: %s", found.robot, error)

    def _report(self, bench: _Bench) -> None:
        now = self._clock.now()
        for ear in bench.ears:
            self._tell(
                LinkReport(
                    robot=ear.robot,
                    carrier=ACOUSTIC_CARRIER,
                    state=self._state(bench, ear, now),
                    heard_at=ear.heard_at,
                    rssi_dbm=None,
                    frames_received=ear.answers,
                    frames_bad=ear.garbled,
                    uri=ear.uri,
                    is_enabled=bench.modem.is_enabled,
                )
            )

    def _state(self, bench: _Bench, ear: _Ear, now: datetime) -> LinkState:
        if not bench.modem.is_enabled:
            return LinkState.DISABLED
        if not bench.opened.is_set():
            return LinkState.MUTE if bench.modem.is_mute else LinkState.PORT_CLOSED
        if ear.heard_at is None:
            return LinkState.NEVER_HEARD
        period_s = max(bench.modem.config.period_s, _LEAST_PERIOD_S * self._clock.speed)
        is_fresh = (now - ear.heard_at).total_seconds() <= _STALE_PERIODS * period_s
        return LinkState.LIVE if is_fresh else LinkState.STALE


def _links_by_modem(robots: Iterable[RobotRecord]) -> list[dict[RobotId, str]]:
    """Return the acoustic links of all robots, those of one modem at the station together."""
    groups: dict[tuple[object, ...], dict[RobotId, str]] = {}
    for robot in robots:
        for uri in robot.links:
            if is_acoustic(uri):
                with contextlib.suppress(ValueError):
                    place = modem_of(acoustic_address(uri))
                    groups.setdefault(place, {})[robot.id] = uri
    return list(groups.values())


async def _end(bench: _Bench) -> None:
    for task in bench.tasks:
        task.cancel()
    await asyncio.gather(*bench.tasks, return_exceptions=True)
