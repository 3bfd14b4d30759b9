"""The trim that belongs to an accepted identification, kept as an advice."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimConfig
from db.query.identifications import IdentificationRecord
from db.query.trim import add_advice
from server.base.configuration import current
from server.base.configuration_kind import find_kind
from server.study.identified import ActuatorOffset, offered_trim
from server.study.task import Document
from server.study.trim_advice import advice_document, for_vehicle


@dataclass(frozen=True, slots=True)
class AcceptedIdentification:
    """A vehicle that was made of an identification, and the trim that belongs to it."""

    vehicle: str
    """Its key in the catalogue."""
    offsets: Sequence[ActuatorOffset]
    advice: Document | None
    """A trim advice, to be accepted like any other once the robot is this vehicle."""
    message: str
    """What the advice is about, or why there is none."""


def keep_offer(
    session: Session,
    record: IdentificationRecord,
    offsets: Sequence[ActuatorOffset],
    vehicle: Vehicle,
    *,
    at: datetime,
    by: str,
) -> AcceptedIdentification:
    """Keep the trim that belongs to an identified vehicle as an advice, if there is one."""
    present = current(session, find_kind("trim"), record.robot)
    offered = offered_trim(record.id, offsets, present.value_as(TrimConfig), vehicle)
    if offered.document is None:
        return AcceptedIdentification(vehicle.key, offsets, None, offered.message)
    advice = add_advice(
        session,
        record.robot,
        record.deployment,
        trim_version=present.etag,
        document=for_vehicle(offered.document, vehicle),
        at=at,
        by=by,
    )
    return AcceptedIdentification(vehicle.key, offsets, advice_document(advice), offered.message)
