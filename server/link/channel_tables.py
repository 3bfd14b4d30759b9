"""Which channels each robot announced, and whether a value means what the catalogue says.

A table holds from one measurement on: what a robot measured before is judged by the table that held
then, however late it comes. A robot that announced nothing is understood by the catalogue alone.
"""

import logging
from bisect import bisect_right
from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.channel import Channel
from db.fault import StoreError
from db.query.fleet.robot_channels import keep_announcement, list_announcements, stored_since
from db.query.station.events import add_event
from robot_link.channel_table import (
    Announcement,
    ChannelPage,
    TableAssembler,
    contradictions,
    difference,
)
from robot_link.messages import RobotId
from robot_link.sample_log import SampleKey
from server.base.foundation import Foundation
from server.fleet.fleet import Fleet

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _Held:
    """A table, and what of it contradicts the catalogue."""

    announced: Announcement
    faults: dict[int, str]
    """By number."""


class ChannelTables:
    """What robots announced. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._pages = TableAssembler()
        self._held: dict[RobotId, list[_Held]] = {}
        """In the order in which they held."""
        self._kept: set[tuple[RobotId, SampleKey]] = set()
        self._doubted: set[RobotId] = set()
        """Robots of which a table contradicts the catalogue, this one or an older one."""

    async def load(self) -> None:
        """Read what robots announced before the station was started."""
        for announced in await self._foundation.store.query(list_announcements):
            if self._fleet.knows(announced.robot):
                self._held.setdefault(announced.robot, []).append(self._judged(announced))
                self._kept.add((announced.robot, announced.since))
        for robot in self._held:
            self._tell_fleet(robot)

    def take(self, page: ChannelPage) -> None:
        """Take a page; once its table is complete, values are judged by that.

        Raises:
            ValueError: If the pages are together not what the robot announced.
        """
        table = self._pages.add(page)
        if table is None:
            return
        since = SampleKey(page.log, page.sequence)
        announced = Announcement(page.robot, table, since, page.measured_at, page.received_at)
        held = self._held.setdefault(page.robot, [])
        known = next((n for n, one in enumerate(held) if one.announced.since == since), None)
        before = held[-1].announced if held else None
        is_same = known is not None and held[known].announced.table == table
        if known is not None and is_same:
            announced = replace(held[known].announced, heard_at=page.received_at)
            held[known] = replace(held[known], announced=announced)
        else:
            held[:] = [one for one in held if one.announced.since != since]
            held.append(self._judged(announced))
            held.sort(key=lambda one: one.announced.since)
        self._tell_fleet(page.robot)
        if not is_same or (page.robot, since) not in self._kept:
            self._foundation.background.start(
                f"channels of {page.robot}", self._keep(announced, before)
            )

    def catalogue_changed(self) -> None:
        """Judge every table by another catalogue."""
        for robot, held in self._held.items():
            held[:] = [self._judged(one.announced) for one in held]
            self._tell_fleet(robot)

    def knows(self, robot: RobotId, version: int) -> bool:
        """Tell whether the newest table of a robot has this version."""
        announced = self._fleet.status(robot).announced
        return announced is not None and announced.table.version == version

    def fault_of_sample(self, robot: RobotId, channel: Channel, name: SampleKey) -> str:
        """Return why a measurement is not what the catalogue says of its channel, or ""."""
        if robot not in self._doubted:
            return ""
        held = self._held[robot]
        place = bisect_right(held, name, key=lambda one: one.announced.since)
        return held[place - 1].faults.get(channel.wire_number, "") if place else ""

    def fault_of_reading(self, robot: RobotId, channel: Channel, at: datetime) -> str:
        """Return why a reading of a moment is not what the catalogue says, or ""."""
        if robot not in self._doubted:
            return ""
        then = [one for one in self._held[robot] if one.announced.since_at <= at]
        return then[-1].faults.get(channel.wire_number, "") if then else ""

    def _judged(self, announced: Announcement) -> _Held:
        catalogue = self._foundation.channels.catalogue
        return _Held(announced, contradictions(announced.table, catalogue))

    def _tell_fleet(self, robot: RobotId) -> None:
        held = self._held[robot]
        is_doubted = any(one.faults for one in held)
        (self._doubted.add if is_doubted else self._doubted.discard)(robot)
        self._fleet.set_announced(robot, held[-1].announced, held[-1].faults)

    async def _keep(self, announced: Announcement, before: Announcement | None) -> None:
        """Write a table down, and into the event log what is new; the next page tries again."""
        catalogue = self._foundation.channels.catalogue
        faults = contradictions(announced.table, catalogue)
        text, level = _news(announced, before)

        def write(session: Session) -> None:
            keep_announcement(session, announced)
            if not text:
                return
            robot, at = announced.robot, announced.heard_at
            data = {"version": announced.version}
            kind = "channels.announced" if before is None else "channels.changed"
            add_event(session, at, kind, text, level=level, robot=robot, data=data)
            for number, fault in faults.items():
                said = (
                    f"{robot} announces its channels otherwise: {fault}. Its values are not used."
                )
                channel = catalogue.numbered(number)
                early = 0 if channel is None else stored_since(session, announced, channel.key)
                if early:
                    said += f" {early} of them were stored before that came, and stay."
                add_event(session, at, "channels.contradict", said, level="watch", robot=robot)

        try:
            await self._foundation.store.write(write)
        except StoreError as error:
            log.warning("the channels of %s are not kept: %s", announced.robot, error)
        else:
            self._kept.add((announced.robot, announced.since))


def _news(announced: Announcement, before: Announcement | None) -> tuple[str, str]:
    """Return a sentence on what a table says, "" for nothing new, and how grave that is."""
    robot, table = announced.robot, announced.table
    if before is None:
        count = len(table.rows)
        return f"{robot} announced {count} channels, version {announced.version}.", "info"
    if before.table == table or announced.since < before.since:
        return "", "info"
    what = difference(before.table, table)
    since = f"{announced.since_at:%H:%M:%S} UTC"
    text = f"{robot} measures otherwise since {since}, version {announced.version}: {what}."
    return text, "watch"
