"""The current of a water on a grid, for a screen and for a file."""

import csv
import io
import math
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.model import CurrentMap
from autonomy.estimation.prediction import ellipse_90
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from server.current.view import FlowArrowView

ACROSS = 14
"""Arrows along the longer side of a domain."""
_DEPTHS = 4
_TOLD = 0.8
"""A standard deviation beyond this part of the prior's tells nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class FlowGrid:
    """Depth-averaged currents at places with water."""

    north_east_m: FloatArray
    """Shape ``(n, 2)``."""
    mean_ne_m_s: FloatArray
    cov_m2_s2: FloatArray
    spacing_m: float
    prior_std_m_s: float


def flow_grid(known: CurrentMap, site: Site, time_s: float) -> FlowGrid:
    """Return the mean current over depth on a grid over a site's domain."""
    box = site.domain
    width = max(box.x_max_m - box.x_min_m, box.y_max_m - box.y_min_m)
    spacing = width / ACROSS
    north = np.arange(box.x_min_m + 0.5 * spacing, box.x_max_m, spacing)
    east = np.arange(box.y_min_m + 0.5 * spacing, box.y_max_m, spacing)
    places = np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).reshape(-1, 2)
    wet = site.floor_m(places[:, 0], places[:, 1]) > 0.0
    if site.shore is not None:
        wet &= site.shore.contains(places[:, 0], places[:, 1])
    places = places[wet]
    depths = (np.arange(_DEPTHS) + 0.5) * box.depth_max_m / _DEPTHS
    flow = known.flow_over_depth(places, depths, time_s)
    return FlowGrid(places, flow.mean_ne_m_s, flow.cov_m2_s2, spacing, known.prior_std_m_s())


def arrows(grid: FlowGrid) -> list[FlowArrowView]:
    """Return the arrows of a grid."""
    found: list[FlowArrowView] = []
    for place, mean, cov in zip(
        grid.north_east_m.tolist(), grid.mean_ne_m_s.tolist(), grid.cov_m2_s2, strict=True
    ):
        axes, direction_rad = ellipse_90(cov)
        std = np.sqrt(np.maximum(np.diag(cov), 0.0)).tolist()
        found.append(
            FlowArrowView(
                north_m=place[0],
                east_m=place[1],
                velocity_ne_m_s=(mean[0], mean[1]),
                std_ne_m_s=(std[0], std[1]),
                ellipse_m_s=axes,
                ellipse_rad=direction_rad,
                is_told=max(std) <= _TOLD * grid.prior_std_m_s,
                is_sure=math.hypot(*mean) >= axes[0],
            )
        )
    return found


def table(grid: FlowGrid, site: Site, at: datetime, *, is_simulation: bool) -> str:
    """Return one row for each place, after comments that explain them."""
    written = io.StringIO()
    if is_simulation:
        written.write("# SIMULATION: this was computed, not measured\n")
    written.write(f"# site: {site.name}\n# time: {at.astimezone(UTC).isoformat()}\n")
    written.write("# depth-averaged current, by the drift of dives between fixes\n")
    rows = csv.writer(written, lineterminator="\n")
    rows.writerow(
        [
            "north [m]",
            "east [m]",
            "latitude [deg]",
            "longitude [deg]",
            "eastward_sea_water_velocity [m/s]",
            "northward_sea_water_velocity [m/s]",
            "eastward_sea_water_velocity standard_error [m/s]",
            "northward_sea_water_velocity standard_error [m/s]",
        ]
    )
    degrees = wgs84_from_ned(grid.north_east_m, site.origin_latitude_deg, site.origin_longitude_deg)
    std = np.sqrt(np.maximum(np.diagonal(grid.cov_m2_s2, axis1=1, axis2=2), 0.0))
    for place, degree, mean, one in zip(
        grid.north_east_m.tolist(),
        degrees.tolist(),
        grid.mean_ne_m_s.tolist(),
        std.tolist(),
        strict=True,
    ):
        numbers = [f"{value:.3f}" for value in place] + [f"{value:.8f}" for value in degree]
        rows.writerow([*numbers, *(f"{v:.5f}" for v in (mean[1], mean[0], one[1], one[0]))])
    return written.getvalue()
