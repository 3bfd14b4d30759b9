"""Columns of a recording that tell how the vehicle flew, beside where it was and what it measured.

With all of them a recording can be held against a model: identification and trim advice need them.
Their names say their units, in which gliders' logs are usually written.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

_DEGREE = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class FlightColumn:
    """One column: what it is called in the database, its factor to SI, its range in the file."""

    key: str
    factor: float
    low: float
    high: float


FLIGHT_COLUMNS: Mapping[str, FlightColumn] = MappingProxyType(
    {
        "roll_deg": FlightColumn("roll_rad", _DEGREE, -180.0, 180.0),
        "pitch_deg": FlightColumn("pitch_rad", _DEGREE, -90.0, 90.0),
        "heading_deg": FlightColumn("heading_rad", _DEGREE, -360.0, 360.0),
        "net_buoyancy_g": FlightColumn("net_buoyancy_kg", 1e-3, -5000.0, 5000.0),
        "mass_position_mm": FlightColumn("mass_position_m", 1e-3, -1000.0, 1000.0),
        "tail_deg": FlightColumn("tail_rad", _DEGREE, -180.0, 180.0),
        "position_std_m": FlightColumn("position_std_m", 1.0, 0.0, 1e5),
    }
)
"""By the name in a file's header. Roll is positive to starboard, pitch nose up, net buoyancy heavy,
mass position forward. A row with a ``position_std_m`` has a position fix of that standard
deviation; an empty cell of any of them says that this row does not tell."""
