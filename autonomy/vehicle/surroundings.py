"""What a robot's body meets: moving and layered water, waves, the floor and the walls."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import Site
from autonomy.vehicle.water import CurrentGrid, CurrentProfile, Flow, WaterColumn, Wave


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Water and borders around one robot, in the site's NED frame.

    Uniform current, profile, grid and waves add up.
    """

    current_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    x_min_m: float = -math.inf
    x_max_m: float = math.inf
    y_min_m: float = -math.inf
    y_max_m: float = math.inf
    floor_m: float = math.inf
    """Depth at which the hull meets the floor."""
    has_walls: bool = False
    current_profile: CurrentProfile | None = None
    current_grid: CurrentGrid | None = None
    column: WaterColumn | None = None
    """Density and temperature; None where the water is as the vehicle's model has it."""
    waves: tuple[Wave, ...] = ()

    @classmethod
    def of_site(
        cls,
        site: Site,
        current_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        column: WaterColumn | None = None,
        waves: tuple[Wave, ...] = (),
    ) -> Self:
        """Take the borders of a site's water; only a tank has walls."""
        water = site.water
        return cls(
            current_ned_m_s,
            water.x_min_m,
            water.x_max_m,
            water.y_min_m,
            water.y_max_m,
            water.depth_max_m,
            site.kind == "tank",
            column=column,
            waves=waves,
        )

    def flow(self, position_ned: FloatArray, time_s: float) -> Flow:
        """Return how the water moves at a place and time."""
        flow = Flow.steady(np.array(self.current_ned_m_s))
        if self.current_profile is not None:
            flow += self.current_profile.flow(float(position_ned[2]))
        if self.current_grid is not None:
            flow += self.current_grid.flow(position_ned)
        for wave in self.waves:
            flow += wave.flow(position_ned, time_s)
        return flow

    def packed(self) -> FloatArray:
        """Return the array that ``extended_kernel.advance`` takes.

        Uniform current, borders and whether there are walls take 9 numbers. Only if there is
        more, 7 numbers say how much (levels of current profile and water column, waves, points of
        the grid along x, y, z) with the ballast density, and profile (depths, north, east), column
        (depths, densities), waves (6 each) and grid (axes, velocities) follow.
        """
        plain = np.array(
            [
                *self.current_ned_m_s,
                self.x_min_m,
                self.x_max_m,
                self.y_min_m,
                self.y_max_m,
                self.floor_m,
                float(self.has_walls),
            ]
        )
        profile, grid, column = self.current_profile, self.current_grid, self.column
        if profile is None and grid is None and column is None and not self.waves:
            return plain
        sizes = np.array(
            [
                0 if profile is None else len(profile.depth_m),
                0 if column is None else len(column.depth_m),
                len(self.waves),
                *((0, 0, 0) if grid is None else grid.velocity_ned_m_s.shape[:3]),
                0.0 if column is None else column.ballast_kg_m3,
            ]
        )
        parts = [plain, sizes]
        if profile is not None:
            parts += [profile.depth_m, *profile.velocity_ne_m_s.T]
        if column is not None:
            parts += [column.depth_m, column.density_kg_m3]
        parts += [np.array(wave.packed()) for wave in self.waves]
        if grid is not None:
            parts += [grid.x_m, grid.y_m, grid.z_m, grid.velocity_ned_m_s.ravel()]
        return np.concatenate(parts, dtype=np.float64)
