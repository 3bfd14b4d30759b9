"""A robot's lists as a page shows them: each value beside the one of yesterday."""

import math
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.measured.telemetry import history
from db.query.mission import checklists as query
from server.base.channels import Channels
from server.base.foundation import Foundation
from server.checklist.check import CHECKS, Finding
from server.checklist.checklists import Checklists, ListStanding
from server.checklist.judging import standing_of
from server.checklist.template import GATING, LAUNCHING, template_of
from server.checklist.view import (
    PastChecklistView,
    RobotChecklistsView,
    list_view,
    past_view,
    start_text,
)

_DAY: Final = timedelta(days=1)
_NEAR: Final = timedelta(minutes=30)
"""A value this near to the hour of yesterday counts as of it."""
_POINTS: Final = 400


class Overview:
    """Reads lists for people. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, checklists: Checklists) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._channels: Channels = foundation.channels
        self._checklists = checklists

    async def of_robot(self, robot: str) -> RobotChecklistsView:
        """Return a robot's lists, those that a start waits for first.

        Raises:
            UnknownIdError: If there is no such robot.
        """
        standing = await self._checklists.standing(robot)
        standing.sort(key=lambda one: one.template.act not in GATING)
        demand = await self._checklists.demand(robot)
        yesterday = await self._yesterday(robot, standing)
        gating = [one for one in standing if one.template.act in GATING]
        launching = [one for one in standing if one.template.act in LAUNCHING]
        return RobotChecklistsView(
            robot,
            demand,
            demand != "required" or all(one.lets_start for one in gating),
            start_text(gating, demand),
            demand != "required" or all(one.lets_start for one in launching),
            start_text(launching, demand, "launch"),
            [list_view(one, yesterday) for one in standing],
        )

    async def past(self, robot: str, before: str | None, limit: int) -> list[PastChecklistView]:
        """Return the runs of a robot, the newest first, as they were."""

        def read(session: Session) -> list[PastChecklistView]:
            found: list[PastChecklistView] = []
            for run in query.newest_runs(session, robot, before, limit):
                template = template_of(run.document)
                findings = {
                    key: Finding(one["is_passed"], one["text"])
                    for key, one in run.found.get("findings", {}).items()
                }
                ticks = query.ticks_of(session, run.id)
                found.append(past_view(run, standing_of(template, findings, ticks)))
            return found

        return await self._store.query(read)

    async def _yesterday(self, robot: str, standing: Sequence[ListStanding]) -> dict[str, str]:
        """Return what channels said at this hour of yesterday, as text with the unit."""
        wanted = sorted(
            {
                CHECKS[item.item.check].channel
                for one in standing
                for item in one.items
                if item.item.check and CHECKS[item.item.check].channel
            }
        )
        then = self._clock.now() - _DAY

        def read(session: Session) -> dict[str, float]:
            found: dict[str, float] = {}
            for channel in wanted:
                kept = history(session, robot, channel, then - _NEAR, then + _NEAR, _POINTS)
                values = zip(kept.measured_at, kept.value, strict=True)
                nearest = min(values, key=lambda pair: _away_s(pair[0], then), default=None)
                if nearest is not None and math.isfinite(nearest[1]):
                    found[channel] = nearest[1]
            return found

        return {
            key: self._words(key, value) for key, value in (await self._store.query(read)).items()
        }

    def _words(self, channel: str, value: float) -> str:
        if channel == "battery_fraction":
            return f"{100.0 * value:.0f} %"
        known = self._channels.catalogue.get(channel)
        return f"{value:.2f} m" if known is None else known.words(value)


def _away_s(moment: datetime, then: datetime) -> float:
    return abs((moment - then).total_seconds())
