"""Reads what the contact window of a robot is reckoned from."""

from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.planner.config import PlannerConfig
from db.query.fleet.onboard import ParameterRecord, list_parameters
from db.query.station.events import newest_of_kinds
from server.base.foundation import Foundation
from server.base.vehicle_catalogue import profile_of
from server.fleet.fleet import Fleet
from server.link.moments import DIVE_BEGUN, DIVE_ENDED
from server.schedule.replan.contact import Facts, contact_of
from server.schedule.replan.view import ContactWindowView


class Contacts:
    """Tells how long robots are in contact. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._store = foundation.store
        self._configurations = foundation.configurations
        self._fleet = fleet

    async def of(self, robot: str) -> ContactWindowView:
        """Return the contact window of a robot.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status = self._fleet.status(robot)
        planner = (await self._configurations.current("planner", robot)).value_as(PlannerConfig)
        up_since, parameters = await self._store.query(lambda session: _told(session, robot))
        return contact_of(
            Facts(
                status=status,
                up_since=up_since,
                turn_time_s=planner.mission.turn_time_s,
                profile=profile_of(self._fleet.vehicle(robot)),
                parameters={one.name: one for one in parameters},
            )
        )


def _told(session: Session, robot: str) -> tuple[datetime | None, list[ParameterRecord]]:
    last = newest_of_kinds(session, robot, (DIVE_BEGUN, DIVE_ENDED))
    is_up = last is not None and last.kind == DIVE_ENDED
    since = datetime.fromisoformat(last.data["measured_at"]) if last is not None and is_up else None
    return since, list(list_parameters(session, robot))
