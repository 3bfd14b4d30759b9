"""Channels of a state as files have them: under names of OG1.0, angles in degrees, true headings.

Everything else is said of them where the robot's reports are declared (``robot_link.messages``).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import convergence_rad
from db.query.measured.merged_rows import RowBlock
from robot_link.messages import STATE
from server.delivery.judged import Wanted

HEADING: Final = "heading_rad"
_NAMES: Final[Mapping[str, str]] = {
    "pitch_rad": "PITCH",
    "roll_rad": "ROLL",
    HEADING: "HEADING",
    "net_buoyancy_kg": "NET_BUOYANCY",
    "mass_position_m": "MASS_POSITION",
    "tail_rad": "TAIL_ANGLE",
    "battery_v": "BATTERY_VOLTAGE",
}


@dataclass(frozen=True, slots=True)
class StateVariable:
    """One channel of a state in files."""

    key: str
    name: str
    """Of the variable."""
    unit: str
    title: str
    help: str
    standard_name: str | None
    factor: float
    """By what values are multiplied."""


def _variable(key: str, name: str) -> StateVariable:
    channel, gauge = STATE[key], STATE.gauges[key]
    is_angle = channel.unit == "rad"
    return StateVariable(
        key=key,
        name=name,
        unit="degree" if is_angle else channel.unit,
        title=gauge.title,
        help="Clockwise from true north." if key == HEADING else gauge.help,
        standard_name=channel.standard_name,
        factor=180.0 / np.pi if is_angle else 1.0,
    )


STATE_VARIABLES: Final = tuple(_variable(key, name) for key, name in _NAMES.items())


def state_values(block: RowBlock, key: str, wanted: Wanted) -> FloatArray:
    """Return values of a channel in the unit of files, shape ``(n,)``; NaN where nobody told.

    Headings are 0 to 360 from true north. A robot of ours tells them from the north of its water's
    frame; where nobody told its place, the two are taken for the same.
    """
    (variable,) = (one for one in STATE_VARIABLES if one.key == key)
    values = block.state[key] * variable.factor
    if key != HEADING:
        return values
    if not wanted.has_true_headings:
        north_east = block.position_ned[:, :2]
        latitude_deg = wanted.deployment.site.origin_latitude_deg
        is_placed = np.isfinite(north_east).all(axis=1)
        values[is_placed] += np.degrees(convergence_rad(north_east[is_placed], latitude_deg))
    return values % 360.0
