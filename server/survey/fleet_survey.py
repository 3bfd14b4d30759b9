"""A survey that several robots of one site share."""

from collections.abc import Mapping, Sequence
from typing import Any

from server.base.problem import FieldError, unprocessable
from server.fleet.fleet import Fleet
from server.fleet.water import Water
from server.survey.surveys import Surveys


class FleetSurveys:
    """Asks several robots for one survey. Belongs to one event loop."""

    def __init__(self, fleet: Fleet, surveys: Surveys) -> None:
        self._fleet = fleet
        self._surveys = surveys

    async def create(
        self, robots: Sequence[str], patch: Mapping[str, Any], *, automation: bool, by: str
    ) -> list[tuple[str, str]]:
        """Ask robots of one site for a survey each, planned against one map.

        Returns:
            Robot and mission, in the order of the request.

        Raises:
            Problem: 422 naming each robot that is unknown, named twice or of another site; else as
                of ``Surveys.create``. Nothing is begun then.
        """
        errors = [
            FieldError(loc=["robots", number], msg=reason)
            for number, robot in enumerate(robots)
            if (reason := self._misfit(robots[:number], robot))
        ]
        if errors:
            count = "1 robot does" if len(errors) == 1 else f"{len(errors)} robots do"
            raise unprocessable(f"{count} not fit into one survey.", errors)
        missions = await self._surveys.create_all(robots, patch, automation=automation, by=by)
        return list(zip(robots, missions, strict=True))

    def _misfit(self, before: Sequence[str], robot: str) -> str:
        """Return why a robot cannot take part beside those named before it, or ""."""
        if not self._fleet.knows(robot):
            return f"there is no robot {robot!r}"
        if robot in before:
            return f"{robot} is named twice"
        first = next((one for one in before if self._fleet.knows(one)), robot)
        here, there = (self._fleet.status(one).record for one in (first, robot))
        if Water.of(here) != Water.of(there):
            return f"{robot} works at {there.site.name}, not with {first} at {here.site.name}"
        return ""
