"""What an identification found beside the parameters: offsets of the actuators, and their trim.

Parameters and offsets are fitted together, so a vehicle without its offsets is half of what was
found. They are told wherever the vehicle is, and offered as a trim advice.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from pydantic import ValidationError
from sqlalchemy.orm import Session

from autonomy.identification.result import IdentificationResult
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimAdvice, TrimConfig, trim_flaw
from server.base.configuration import current
from server.base.configuration_kind import find_kind
from server.base.vehicle_catalogue import vehicle_digest
from server.study.trim import add_advice
from server.study.view import (
    AcceptedVehicleView,
    ActuatorOffsetView,
    AdviceAsked,
    IdentificationView,
)

_OFFSETS = {
    "net_buoyancy_offset_kg": ("net buoyancy", 1e3, "g"),
    "mass_position_offset_m": ("mass position", 1e3, "mm"),
}
"""Names as in ``TrimConfig``; what people call them, and the unit in which they are told."""
_SURE = 2.0
"""A change of less than so many standard deviations is not worth a change of trim."""


@dataclass(frozen=True, slots=True)
class OfferedTrim:
    """The trim that belongs to an identified vehicle, or why none is offered."""

    advice: TrimAdvice | None
    message: str


def offsets_of(result: IdentificationResult) -> list[ActuatorOffsetView]:
    """Return the actuator offsets that a result holds; none if they were not sought."""
    return [
        ActuatorOffsetView(
            name=one.name, unit=one.unit, value=one.after, std=one.std, verdict=one.verdict
        )
        for one in result.parameters
        if one.name in _OFFSETS and one.verdict != "fixed"
    ]


def keep_offer(
    session: Session,
    search: IdentificationView,
    offsets: Sequence[ActuatorOffsetView],
    vehicle: Vehicle,
    *,
    at: datetime,
    by: str,
) -> AcceptedVehicleView:
    """Keep the trim that belongs to an identified vehicle as an advice, if there is one."""
    present = current(session, find_kind("trim"), search.robot)
    offered = offered_trim(search.id, offsets, present.value_as(TrimConfig), vehicle)
    advice = None
    if offered.advice is not None:
        asked = AdviceAsked(
            deployment=search.deployment,
            trim_version=present.etag,
            vehicle=vehicle.key,
            vehicle_digest=vehicle_digest(vehicle),
            identification=search.id,
        )
        advice = add_advice(session, search.robot, asked, offered.advice, at=at, by=by)
    return AcceptedVehicleView(
        vehicle=vehicle.key,
        offsets=list(offsets),
        trim_advice=advice,
        trim_message=offered.message,
    )


def note_of(identification: str, deployment: str, offsets: Sequence[ActuatorOffsetView]) -> str:
    """Return what a catalogue says of an identified vehicle."""
    note = f"identified from {deployment} by {identification}"
    if not offsets:
        return note
    told = " and ".join(_words(one) for one in offsets)
    return f"{note}, together with offsets of the actuators' feedback: {told}"


def offered_trim(
    identification: str,
    offsets: Sequence[ActuatorOffsetView],
    present: TrimConfig,
    vehicle: Vehicle,
) -> OfferedTrim:
    """Return the trim that takes the offsets of an identified vehicle away.

    An offset that the data do not tell stays as the robot has it.

    Args:
        identification: Where the offsets come from.
        offsets: What it found.
        present: The robot's trim now.
        vehicle: The vehicle that was identified.
    """
    known = {one.name: one for one in offsets if one.is_known}
    if not known:
        sought = "does not tell" if offsets else "did not seek"
        return OfferedTrim(None, f"{identification} {sought} offsets of the actuators.")
    wanted = {
        "net_buoyancy_offset_kg": present.net_buoyancy_offset_kg,
        "mass_position_offset_m": present.mass_position_offset_m,
        **{name: one.value for name, one in known.items()},
    }
    told = " and ".join(_words(one) for one in known.values())
    try:
        full = TrimConfig.model_validate(wanted)
        flaw = trim_flaw(full.net_buoyancy_offset_kg, full.mass_position_offset_m, vehicle.limits)
    except ValidationError:
        full, flaw = present, "that is beyond what a trim can hold"
    if flaw:
        return OfferedTrim(
            None, f"The feedback is off by {told}, but {flaw}: mend the ballast or the sensor."
        )
    message = (
        f"{identification} found that the feedback is off by {told}. This trim belongs to the "
        f"vehicle {vehicle.key}: make it the robot's model, then accept the trim."
    )
    advice = TrimAdvice(
        dives=0,
        present=present,
        full_step=full,
        half_step=present.stepped(full.net_buoyancy_offset_kg, full.mass_position_offset_m, 0.5),
        net_buoyancy_std_kg=_std(known, "net_buoyancy_offset_kg"),
        mass_position_std_m=_std(known, "mass_position_offset_m"),
        rmse_now=None,
        rmse_proposed=None,
        is_worth_it=any(
            abs(one.value - getattr(present, name)) > _SURE * (one.std or math.inf)
            for name, one in known.items()
        ),
        message=message,
    )
    return OfferedTrim(advice, message)


def _words(offset: ActuatorOffsetView) -> str:
    """Return an offset as pilots say it."""
    title, scale, unit = _OFFSETS[offset.name]
    said = f"{title} {offset.value * scale:+.2f} {unit}"
    if offset.std is None or not offset.is_known:
        return f"{said} ({offset.verdict})"
    return f"{said} (±{offset.std * scale:.2f})"


def _std(known: Mapping[str, ActuatorOffsetView], name: str) -> float | None:
    return known[name].std if name in known else None
