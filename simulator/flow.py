"""Flows of the simulated water, by place, depth and time. Neither robot nor station is told."""

import logging
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.ocean_file import OceanFileError, read_ocean_file
from autonomy.current.table import FlowTable, flow_at
from autonomy.current.told import ToldCurrent
from autonomy.site import Box, Site

_SPEED_M_S = {"tank": 0.02}
_USUAL_SPEED_M_S = 0.05
"""Speed of a flow where nobody says another, in a tank and elsewhere."""
_FASTEST_M_S = 2.0
_M2_H = 12.4206
_SAME = np.array([2.0, 2.0, 0.2, 10.0])
"""Changes of north, east and depth, m, and time, s, that an ocean model does not resolve."""
_log = logging.getLogger(__name__)
KINDS = ("uniform", "gyre", "double", "shear", "tide")
"""Flows by name."""
GRAMMAR = (
    "KIND[:SPEED][@TOWARDS][/HOURS], several joined by +; a kind is one of "
    + ", ".join(KINDS)
    + "; SPEED in m/s, TOWARDS in degrees from north, HOURS the period of a tide; "
    "such as gyre, uniform:0.02@90, gyre:0.05+tide:0.08/2; or FILE.nc, the CF NetCDF of an ocean "
    "model"
)


class Flow(Protocol):
    """Velocity of the water by place and time."""

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity at points, shape ``(n, 2)``, m/s.

        Args:
            points: North, east and depth m, time s, shape ``(n, 4)``.
        """
        ...


@dataclass(frozen=True, slots=True)
class Uniform:
    """The same everywhere and always."""

    north_m_s: float
    east_m_s: float

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity."""
        return _along((self.north_m_s, self.east_m_s), np.ones(len(points)))


@dataclass(frozen=True, slots=True)
class Gyre:
    r"""Gyres side by side that fill a box: stream function :math:`\sin a \sin b`."""

    speed_m_s: float
    """Greatest speed, at the box's edges; negative turns the other way."""
    box: Box
    cells_north: int = 1
    cells_east: int = 1

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity."""
        box = self.box
        ka = math.pi * self.cells_north / (box.x_max_m - box.x_min_m)
        kb = math.pi * self.cells_east / (box.y_max_m - box.y_min_m)
        a = ka * (points[:, 0] - box.x_min_m)
        b = kb * (points[:, 1] - box.y_min_m)
        scale = self.speed_m_s / max(ka, kb)
        return scale * np.column_stack([kb * np.sin(a) * np.cos(b), -ka * np.cos(a) * np.sin(b)])


@dataclass(frozen=True, slots=True)
class Shear:
    """What the wind drives at the surface and the depth returns: without flow in the mean."""

    north_m_s: float
    """At the surface."""
    east_m_s: float
    depth_m: float
    """Of the floor."""

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity."""
        share = np.clip(points[:, 2] / self.depth_m, 0.0, 1.0)
        return _along((self.north_m_s, self.east_m_s), (1.0 - share) * (1.0 - 3.0 * share))


@dataclass(frozen=True, slots=True)
class Tide:
    """An ellipse that the current runs through in one period, the same everywhere."""

    major_m_s: float
    minor_m_s: float
    """Along the shorter axis; negative turns the other way."""
    towards_rad: float
    """Of the longer axis, from north towards east."""
    period_s: float
    phase_rad: float = 0.0

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity."""
        angle = 2.0 * math.pi * points[:, 3] / self.period_s + self.phase_rad
        cos, sin = math.cos(self.towards_rad), math.sin(self.towards_rad)
        along = _along((cos, sin), self.major_m_s * np.cos(angle))
        return along + _along((-sin, cos), self.minor_m_s * np.sin(angle))


@dataclass(frozen=True, slots=True)
class Sum:
    """Several flows at once."""

    parts: tuple[Flow, ...]

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity."""
        found = np.zeros((len(points), 2))
        for part in self.parts:
            found += part.velocity_ne_m_s(points)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Tabled:
    """What a table says, such as that of a current's map."""

    table: FlowTable

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity."""
        found = [flow_at(self.table, *point) for point in points.tolist()]
        return np.array(found).reshape(-1, 2)


class Modelled:
    """What an ocean model says; still where it says nothing.

    Looked up anew once the asker is elsewhere or later, as it is asked many times a second.
    """

    def __init__(self, told: ToldCurrent) -> None:
        self._told = told
        self._points = np.empty((0, 4))
        self._velocity = np.empty((0, 2))

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity."""
        known = self._points
        if known.shape != points.shape or not (np.abs(points - known) <= _SAME).all():
            self._points = points.copy()
            self._velocity = np.nan_to_num(self._told.velocity_ne_m_s(points))
        return self._velocity


def read_flow(text: str, site: Site) -> Flow:
    """Return the flow that a text names (``GRAMMAR``), in the water of a site.

    Raises:
        ValueError: If it cannot be read; the sentence says what can.
    """
    parts = tuple(_read_part(part, site) for part in text.split("+"))
    return parts[0] if len(parts) == 1 else Sum(parts)


def _read_part(text: str, site: Site) -> Flow:
    if text.strip().endswith(".nc"):
        return _read_file(Path(text.strip()), site)
    rest, _, hours = text.strip().partition("/")
    rest, _, towards = rest.partition("@")
    kind, _, speed = rest.partition(":")
    try:
        speed_m_s = float(speed) if speed else _SPEED_M_S.get(site.kind, _USUAL_SPEED_M_S)
        towards_rad = math.radians(float(towards or 45.0))
        period_s = 3600.0 * float(hours or _M2_H)
    except ValueError:
        raise ValueError(f"{text!r} is no flow: {GRAMMAR}") from None
    usual = kind in KINDS and (kind == "tide" or not hours) and period_s > 0.0
    if not usual or not abs(speed_m_s) <= _FASTEST_M_S or not math.isfinite(towards_rad):
        raise ValueError(f"{text!r} is no flow: {GRAMMAR}")
    north, east = speed_m_s * math.cos(towards_rad), speed_m_s * math.sin(towards_rad)
    match kind:
        case "uniform":
            return Uniform(north, east)
        case "shear":
            return Shear(north, east, site.water.depth_max_m)
        case "tide":
            return Tide(speed_m_s, 0.3 * speed_m_s, towards_rad, period_s)
        case _:
            return Gyre(speed_m_s, site.water, cells_east=2 if kind == "double" else 1)


def _read_file(path: Path, site: Site) -> Flow:
    """Return the flow of an ocean model; none where its file is about another place."""
    origin = (site.origin_latitude_deg, site.origin_longitude_deg)
    try:
        reading = read_ocean_file(path, origin, site.water)
    except OceanFileError as error:
        if error.is_elsewhere:
            _log.warning("%s says nothing of %s: %s", path, site.name, error)
            return Uniform(0.0, 0.0)
        raise OceanFileError(str(path), str(error)) from error
    return Modelled(ToldCurrent(reading.grid, origin))


def _along(direction: tuple[float, float], speeds: FloatArray) -> FloatArray:
    return np.multiply.outer(speeds, direction)
