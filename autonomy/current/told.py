"""Currents that somebody tells of a water: constant, a profile over depth, or an ocean model's.

Beyond its extent, its depth or its time a told current says nothing (NaN) instead of a stale value.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.content_file import content_of, find_content, head_of, keep_content
from autonomy.frames import convergence_rad, wgs84_from_ned

_MAGIC = b"GRACE current 1\n"
_SUFFIX = ".current"
_KNOWN_SHARE = 0.5
"""Least weight of the corners of a cell that are known, for the cell to tell anything."""


class ToldField(Protocol):
    """A current by latitude, longitude, depth and time."""

    @property
    def from_s(self) -> float:
        """From when it tells, s since the epoch; -inf for always."""
        ...

    @property
    def until_s(self) -> float:
        """Until when it tells, s since the epoch; inf for ever."""
        ...

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return northward and eastward velocity, NaN where nothing is told, shape ``(n, 2)``.

        Args:
            points: Latitude and longitude, degrees, depth, m, time, s, shape ``(n, 4)``.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class ToldProfile:
    """A current by depth, the same everywhere; of one level the same at every depth.

    Above the shallowest level it is what it is there; below the deepest it says nothing.
    """

    depth_m: FloatArray
    """Ascending, shape ``(n,)``."""
    velocity: FloatArray
    """Northward and eastward, m/s, shape ``(n, 2)``."""
    from_s: float
    until_s: float

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return northward and eastward velocity, NaN where nothing is told."""
        depth, time = points[:, 2], points[:, 3]
        found = np.stack(
            [np.interp(depth, self.depth_m, self.velocity[:, axis]) for axis in range(2)], axis=1
        )
        found[(time < self.from_s) | (time > self.until_s)] = np.nan
        if len(self.depth_m) > 1:
            found[depth > self.depth_m[-1]] = np.nan
        return found


@dataclass(frozen=True, slots=True, eq=False)
class ToldGrid:
    """A current on a grid of an ocean model, linear in between in place, depth and time.

    Above the shallowest level it is what it is there. Where corners of a cell are unknown (land),
    the others tell as long as they have half of the weight.
    """

    latitude_deg: FloatArray
    longitude_deg: FloatArray
    depth_m: FloatArray
    """Positive down; a single level tells of the depths down to it."""
    time_s: FloatArray
    """Seconds since the epoch. All axes ascend; of places and times there are two at least."""
    velocity: npt.NDArray[np.float32]
    """Northward and eastward, m/s, NaN where unknown: times, depths, latitudes, longitudes, 2."""

    @property
    def from_s(self) -> float:
        """The first moment of the grid."""
        return float(self.time_s[0])

    @property
    def until_s(self) -> float:
        """The last moment of the grid."""
        return float(self.time_s[-1])

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return northward and eastward velocity, NaN where nothing is told."""
        longitude = self.longitude_deg[0] + (points[:, 1] - self.longitude_deg[0]) % 360.0
        depth = np.maximum(points[:, 2], self.depth_m[0])
        axes = (self.time_s, self.depth_m, self.latitude_deg, self.longitude_deg)
        wanted = (points[:, 3], depth, points[:, 0], longitude)
        cells = [_cell(axis, at) for axis, at in zip(axes, wanted, strict=True)]
        is_inside = np.stack([inside for _, _, inside in cells]).all(axis=0)
        total = np.zeros((len(points), 2))
        known = np.zeros(len(points))
        for corner in range(16):
            at: list[npt.NDArray[np.intp]] = []
            weight = np.ones(len(points))
            for axis, (below, share, _) in enumerate(cells):
                is_next = bool(corner >> axis & 1)
                at.append(np.minimum(below + is_next, len(axes[axis]) - 1))
                weight *= share if is_next else 1.0 - share
            here = self.velocity[tuple(at)].astype(np.float64)
            is_known: npt.NDArray[np.bool_] = np.asarray(np.isfinite(here).all(axis=1))
            weight *= is_known
            total += weight[:, None] * np.where(is_known[:, None], here, 0.0)
            known += weight
        tells: npt.NDArray[np.bool_] = np.asarray(is_inside & (known >= _KNOWN_SHARE))
        found = total / np.maximum(known, _KNOWN_SHARE)[:, None]
        return np.where(tells[:, None], found, np.nan)

    def content(self) -> bytes:
        """Return the grid as it is kept; equal grids give equal bytes."""
        axes = (self.time_s, self.depth_m, self.latitude_deg, self.longitude_deg)
        arrays = [np.ascontiguousarray(axis, "<f8") for axis in axes]
        values = np.ascontiguousarray(self.velocity, "<f4")
        return content_of(_MAGIC, {"shape": [len(axis) for axis in axes]}, [*arrays, values])


def _cell(
    axis: FloatArray, at: FloatArray
) -> tuple[npt.NDArray[np.intp], FloatArray, npt.NDArray[np.bool_]]:
    """Return the line below each value, how far on to the next it is, and whether it is inside."""
    is_inside = (at >= axis[0]) & (at <= axis[-1])
    if len(axis) == 1:
        return np.zeros(len(at), np.intp), np.zeros(len(at)), is_inside
    kept = np.clip(at, axis[0], axis[-1])
    below = np.clip(np.searchsorted(axis, kept, side="right") - 1, 0, len(axis) - 2)
    return below, (kept - axis[below]) / (axis[below + 1] - axis[below]), is_inside


def keep_grid(folder: Path, grid: ToldGrid) -> str:
    """Write a grid into a folder and return its SHA-256; one that is there already stays."""
    return keep_content(folder, grid.content(), _SUFFIX)


def find_grid(folder: Path, sha256: str) -> ToldGrid | None:
    """Return a grid, None where the folder has it not, or not whole."""
    content = find_content(folder, sha256, _SUFFIX)
    if content is None or not content.startswith(_MAGIC):
        return None
    head, at = head_of(_MAGIC, content)
    axes: list[FloatArray] = []
    for count in head["shape"]:
        axes.append(np.frombuffer(content, "<f8", count, at))
        at += 8 * count
    velocity = np.frombuffer(content, "<f4", offset=at).reshape(*head["shape"], 2)
    return ToldGrid(axes[2], axes[3], axes[1], axes[0], velocity)


@dataclass(frozen=True, slots=True, eq=False)
class ToldCurrent:
    """A told current in the frame of a water."""

    field: ToldField
    origin: tuple[float, float]
    """Latitude and longitude of the frame, degrees."""
    std_m_s: float = 0.1
    """Standard deviation of what it tells, per axis."""

    def velocity_ne_m_s(self, points: FloatArray) -> FloatArray:
        """Return north and east velocity, NaN where nothing is told, shape ``(n, 2)``.

        Args:
            points: North, east and depth, m, time, s since the epoch, shape ``(n, 4)``.
        """
        if isinstance(self.field, ToldProfile):
            return self.field.velocity_ne_m_s(points)
        globe = np.concatenate([wgs84_from_ned(points[:, :2], *self.origin), points[:, 2:]], 1)
        north, east = self.field.velocity_ne_m_s(globe).T
        turn = convergence_rad(points[:, :2], self.origin[0])
        cos, sin = np.cos(turn), np.sin(turn)
        return np.stack([cos * north + sin * east, cos * east - sin * north], axis=1)
