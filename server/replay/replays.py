"""Answers what a replay asks; it keeps no cursor, for each tab of a browser has its own."""

import asyncio
from collections import OrderedDict
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from autonomy.channel import ALARM_LEVELS
from db.deployment_span import Period
from db.query.fleet.deployments import DeploymentRecord, deployment_at
from db.query.measured.moment import told_columns
from db.query.storage.told import PrunedStretch, pruned_stretches
from db.record import same
from robot_link.messages import RobotId
from server.base.foundation import Foundation
from server.fix.view import fix_view
from server.fleet.fleet import Fleet
from server.fleet.view import DeploymentBriefView
from server.replay.moment import (
    ChannelsThen,
    RobotThen,
    Stretch,
    position_then,
    robot_then,
    stretch_around,
)
from server.replay.view import (
    AlarmThenView,
    BesideView,
    MapThenView,
    MarkView,
    PlanThenView,
    RobotThenView,
    TimelineView,
)
from server.scene.replay_host import moment_asked
from server.scene.replay_source import Clock

_TOLD_MAX: Final = 64
_GRAVEST_FIRST: Final = {level: -place for place, level in enumerate(ALARM_LEVELS)}


class Replays:
    """Reads moments. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._told: OrderedDict[tuple[RobotId, Period, int], frozenset[str]] = OrderedDict()
        """Which columns were ever told, by robot and by time and rows of a deployment that is over:
        a person may correct its times, and a recording or a card bring more."""
        self._reading = asyncio.Lock()

    async def moment(self, robot: RobotId, at: datetime, clock: Clock) -> RobotThenView:
        """Return everything that was known of a robot at a moment.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 422 for a moment that has not come yet, or is before any robot's.
        """
        record = self._fleet.status(robot).record
        if record.kind == "recorded":
            clock = "measured"  # nobody heard a recording
        at = moment_asked(at, self._foundation.clock.now())
        told, channels = await self._ever_told(robot, at), self._foundation.channels.catalogue
        then = await self._foundation.store.query(
            lambda session: robot_then(
                session, robot, record.site, at, told, channels, heard=clock == "received"
            )
        )
        return self._view(robot, then, clock)

    async def timeline(self, robot: RobotId, at: datetime) -> TimelineView:
        """Return the time around a moment that belongs together.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 422 for a moment that has not come yet, or is before any robot's.
        """
        self._fleet.status(robot)
        now = self._foundation.clock.now()
        at = moment_asked(at, now)

        def read(session: Session) -> tuple[Stretch, list[PrunedStretch]]:
            found = stretch_around(session, robot, at, now)
            period = found.period
            pruned = pruned_stretches(session, robot, start=period.first, end=period.last)
            return found, pruned

        found, pruned = await self._foundation.store.query(read)
        last = found.period.last
        return TimelineView(
            robot=robot,
            deployment=_brief(found.deployment),
            begins_at=found.period.first,
            ends_at=now if last is None else min(last, now),
            lasts=last is None,
            marks=[same(MarkView, one) for one in found.marks],
            is_cut=found.is_cut,
            pruned=[one.text for one in pruned],
        )

    async def _ever_told(self, robot: RobotId, at: datetime) -> frozenset[str]:
        """Return which columns of its reports a robot told in the deployment of a moment.

        They are counted once of a deployment that is over. While it lasts, the last reports tell.
        """
        deployment = await self._foundation.store.query(
            lambda session: deployment_at(session, robot, at)
        )
        if deployment is None or deployment.ended_at is None:
            return frozenset()
        period = deployment.period
        key = (robot, period, deployment.rows)
        async with self._reading:
            if key not in self._told:
                self._told[key] = await self._foundation.store.query(
                    lambda session: told_columns(session, robot, period)
                )
            while len(self._told) > _TOLD_MAX:
                self._told.popitem(last=False)
            return self._told[key]

    def _view(self, robot: RobotId, then: RobotThen, clock: Clock) -> RobotThenView:
        catalogue = self._foundation.channels.catalogue
        known, place, plan = then.known, then.known.place, then.plan
        channels = ChannelsThen(catalogue, self._fleet.speed).channels(robot, then)
        return RobotThenView(
            robot=robot,
            at=then.at,
            clock=clock,
            deployment=_brief(then.deployment),
            channels=channels,
            untold=sorted(key for key in known.undated if key in catalogue),
            position=None if place is None else position_then(place, then.site, then.at),
            fix=None if then.fix is None else fix_view(then.fix),
            mode=None if known.mode is None else known.mode.name.lower(),
            mode_at=known.mode_at,
            plan=None if plan is None else PlanThenView(plan.id, plan.state, then.leg),
            alarms=sorted(
                (
                    same(
                        AlarmThenView,
                        one,
                        is_acknowledged=one.acknowledged_at is not None
                        and one.acknowledged_at <= then.at,
                    )
                    for one in then.alarms
                ),
                key=lambda one: _GRAVEST_FIRST[one.level],
            ),
            maps=[MapThenView(variable, model, kept) for _, variable, model, kept in then.maps],
            beside=same(BesideView, then.beside),
        )


def _brief(deployment: DeploymentRecord | None) -> DeploymentBriefView | None:
    if deployment is None:
        return None
    return DeploymentBriefView(deployment.id, deployment.title, deployment.begun_at)
