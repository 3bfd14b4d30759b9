"""What an identification found beside the parameters: offsets of the actuators, and their trim.

Parameters and offsets are fitted together, so a vehicle without its offsets is half of what was
found. They are told wherever the vehicle is, and offered as a trim advice.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimConfig, trim_flaw

_OFFSETS = {
    "net_buoyancy_offset_kg": ("net buoyancy", 1e3, "g"),
    "mass_position_offset_m": ("mass position", 1e3, "mm"),
}
"""Names as in ``TrimConfig``; what people call them, and the unit in which they are told."""
_SURE = 2.0
"""A change of less than so many standard deviations is not worth a change of trim."""


@dataclass(frozen=True, slots=True)
class ActuatorOffset:
    """Constant error of an actuator's feedback: what it reports less what is true."""

    name: str
    """As the field of ``TrimConfig``: this trim takes the error away."""
    unit: str
    value: float
    std: float | None
    """``None`` where the data do not tell it."""
    verdict: str

    @property
    def is_known(self) -> bool:
        """Whether the data tell it."""
        return self.std is not None and self.verdict in {"identified", "weak"}

    @property
    def words(self) -> str:
        """The offset as pilots say it."""
        title, scale, unit = _OFFSETS[self.name]
        if self.std is None or not self.is_known:
            return f"{title} {self.value * scale:+.2f} {unit} ({self.verdict})"
        return f"{title} {self.value * scale:+.2f} {unit} (±{self.std * scale:.2f})"


@dataclass(frozen=True, slots=True)
class OfferedTrim:
    """The trim that belongs to an identified vehicle, or why none is offered."""

    document: Mapping[str, Any] | None
    """Has the keys of a trim advice; its errors of glide are null, for nothing was flown with
    it."""
    message: str


def offsets_of(result: Mapping[str, Any]) -> list[ActuatorOffset]:
    """Return the actuator offsets that a result holds; none if they were not sought."""
    return [
        ActuatorOffset(one["name"], one["unit"], one["after"], one["std"], one["verdict"])
        for one in result["parameters"]
        if one["name"] in _OFFSETS and one["verdict"] != "fixed"
    ]


def note_of(identification: str, deployment: str, offsets: Sequence[ActuatorOffset]) -> str:
    """Return what a catalogue says of an identified vehicle."""
    note = f"identified from {deployment} by {identification}"
    if not offsets:
        return note
    told = " and ".join(one.words for one in offsets)
    return f"{note}, together with offsets of the actuators' feedback: {told}"


def offered_trim(
    identification: str, offsets: Sequence[ActuatorOffset], present: TrimConfig, vehicle: Vehicle
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
    now = present.model_dump()
    full = now | {name: one.value for name, one in known.items()}
    half = {name: now[name] + 0.5 * (value - now[name]) for name, value in full.items()}
    told = " and ".join(one.words for one in known.values())
    flaw = _flaw(full, vehicle)
    if flaw:
        return OfferedTrim(
            None, f"The feedback is off by {told}, but {flaw}: mend the ballast or the sensor."
        )
    changes = [
        abs(one.value - now[name]) > _SURE * (one.std or math.inf) for name, one in known.items()
    ]
    message = (
        f"{identification} found that the feedback is off by {told}. This trim belongs to the "
        f"vehicle {vehicle.key}: make it the robot's model, then accept the trim."
    )
    document = {
        "dives": 0,
        "identification": identification,
        **full,
        "net_buoyancy_std_kg": _std(known, "net_buoyancy_offset_kg"),
        "mass_position_std_m": _std(known, "mass_position_offset_m"),
        "rmse_now": None,
        "rmse_proposed": None,
        "half_step": half,
        "full_step": full,
        "present": now,
        "message": message,
        "is_worth_it": any(changes),
    }
    return OfferedTrim(document, message)


def _flaw(trim: Mapping[str, float], vehicle: Vehicle) -> str:
    """Return why a trim cannot be a robot's, or ""."""
    try:
        wanted = TrimConfig.model_validate(trim)
    except ValidationError:
        return "that is beyond what a trim can hold"
    return trim_flaw(wanted.net_buoyancy_offset_kg, wanted.mass_position_offset_m, vehicle.limits)


def _std(known: Mapping[str, ActuatorOffset], name: str) -> float | None:
    return known[name].std if name in known else None
