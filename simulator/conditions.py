"""What the open water is like on a simulated day: layers by temperature, and waves."""

from dataclasses import dataclass

import numpy as np

from autonomy.site import Site
from autonomy.vehicle.surroundings import Surroundings
from autonomy.vehicle.water import WaterColumn, Wave

_SURFACE_C = 22.0
_THERMOCLINE = (0.3, 0.5)
"""Where the warm layer ends and the cold one begins, as shares of the greatest depth."""


@dataclass(frozen=True, slots=True)
class WaterConditions:
    """Layers and waves of lakes and seas; a tank is mixed and calm whatever they say."""

    temperature_drop_c: float = 0.0
    """How much colder the deep water is than the surface at 22 degrees Celsius."""
    wave_height_m: float = 0.0
    """From trough to crest."""
    wave_period_s: float = 2.0
    wave_direction_rad: float = 0.0
    """Where the waves run to, from north towards east."""

    def surroundings(self, site: Site) -> Surroundings:
        """Return the water of a site on such a day, without its current."""
        if site.kind == "tank":
            return Surroundings.of_site(site)
        return Surroundings.of_site(site, column=self._column(site), waves=self._waves())

    def _column(self, site: Site) -> WaterColumn | None:
        if self.temperature_drop_c == 0.0:
            return None
        shares = np.array([0.0, *_THERMOCLINE, 1.0])
        warm, cold = _SURFACE_C, _SURFACE_C - self.temperature_drop_c
        temperature_c = np.array([warm, warm, cold, cold])
        return WaterColumn.fresh(shares * site.water.depth_max_m, temperature_c)

    def _waves(self) -> tuple[Wave, ...]:
        if self.wave_height_m == 0.0:
            return ()
        return (Wave(self.wave_height_m, self.wave_period_s, self.wave_direction_rad),)
