"""Settings of the map of a water's current, and what they are as delivered for each water."""

from itertools import combinations
from typing import Self

from pydantic import Field, model_validator

from autonomy.configuration import Configuration, quantity
from autonomy.site import Site

_REACH_WIDTHS = 5.0
_PERIOD_DIFFERENCE = 0.01
_M2_H = 12.4206


class CurrentMapConfig(Configuration):
    """How the current of a water is mapped from the drift of dives."""

    enabled: bool = quantity(True, title="Map the current")
    """Make a map of the current from every dive that a fix has ended."""
    basin_std_m_s: float = quantity(0.03, "m/s", title="Basin-wide current", ge=0.0, le=3.0)
    """Standard deviation of the part that is the same everywhere, per axis."""
    basin_memory_s: float = quantity(
        432_000.0, "s", title="Basin-wide current stays for", ge=3600.0, le=1e8, advanced=True
    )
    """Time after which a third (1/e) of the basin-wide current is left."""
    eddy_std_m_s: float = quantity(0.03, "m/s", title="Eddies", ge=0.0, le=3.0)
    """Standard deviation of the part that differs from place to place, per axis."""
    eddy_length_m: float = quantity(150.0, "m", title="Size of eddies", ge=0.5, le=1e6)
    """Distance over which eddies stay alike."""
    eddy_memory_s: float = quantity(
        864_000.0, "s", title="Life of eddies", ge=600.0, le=1e8, advanced=True
    )
    """Time after which a third of an eddy is left."""
    incompressible: bool = quantity(True, title="Water neither gathers nor vanishes", advanced=True)
    """Eddies have no divergence: what flows in at one side flows out at another."""
    changing_std_m_s: float = quantity(0.01, "m/s", title="Changing current", ge=0.0, le=3.0)
    """Standard deviation of the part that changes soon, such as what the wind drives."""
    changing_memory_s: float = quantity(
        36_000.0, "s", title="Changing current changes within", ge=600.0, le=1e7, advanced=True
    )
    """Time after which a third of the changing current is left."""
    inertial: bool = quantity(False, title="Turns with the earth", advanced=True)
    """The changing current turns at the inertial frequency of the site's latitude."""
    shear_std_m_s: float = quantity(0.015, "m/s", title="Shear with depth", ge=0.0, le=3.0)
    """Standard deviation of the part that differs from depth to depth."""
    shear_length_m: float = quantity(
        5.0, "m", title="Depth of layers", ge=0.1, le=5000.0, advanced=True
    )
    """Change of depth over which that part stays alike."""
    tide_std_m_s: tuple[float, ...] = Field(
        default=(0.0,), title="Tide", max_length=4, json_schema_extra={"unit": "m/s"}
    )
    """Standard deviation of each tidal current, per axis; 0 for none."""
    tide_periods_h: tuple[float, ...] = Field(
        default=(_M2_H,),
        title="Periods of the tide",
        max_length=4,
        json_schema_extra={"unit": "h", "advanced": True},
    )
    """Period of each tidal current, h; they differ by more than 1 %."""
    reach_m: float = quantity(
        2100.0, "m", title="Tide and changing current alike within", ge=10.0, le=1e7, advanced=True
    )
    """Distance over which tide, changing current and shear stay alike."""
    walk_factor: float = quantity(
        1.0, title="Trust in dead reckoning", ge=0.1, le=10.0, advanced=True
    )
    """How many times its stated drift the robot's dead reckoning walks."""
    learn: bool = quantity(True, title="Learn from the dives")
    """Learn strength and size of the parts from the dives themselves."""
    learn_first: int = quantity(6, title="Dives before learning", ge=4, le=100, advanced=True)
    """Observations after which the station learns for the first time."""
    learn_every: int = quantity(8, title="Dives between learning", ge=1, le=100, advanced=True)
    """New observations after which it learns again."""
    gate: float = quantity(13.8, title="Strange dives", ge=4.0, le=1e6, advanced=True)
    """Squared error, in its own covariance, beyond which a dive is doubted (13.8: 1 in 1000)."""
    dives_max: int = quantity(120, title="Most dives", ge=10, le=400, advanced=True)
    """Newest observations that the map is made of."""

    @model_validator(mode="after")
    def _tides_are_told_apart(self) -> Self:
        if len(self.tide_std_m_s) != len(self.tide_periods_h):
            raise ValueError("tide_std_m_s and tide_periods_h need as many entries as each other")
        if any(not 0.0 <= std <= 3.0 for std in self.tide_std_m_s):
            raise ValueError("tide_std_m_s must lie between 0 and 3 m/s")
        if any(not 0.1 <= period <= 400.0 for period in self.tide_periods_h):
            raise ValueError("tide_periods_h must lie between 0.1 and 400 h")
        for a, b in combinations(self.tide_periods_h, 2):
            if abs(a - b) <= _PERIOD_DIFFERENCE * max(a, b):
                raise ValueError(f"periods {a:g} h and {b:g} h of the tide differ by too little")
        return self


CURRENT_PRESETS: dict[str, CurrentMapConfig] = {
    "lake": CurrentMapConfig(),
    "sea": CurrentMapConfig(
        basin_std_m_s=0.10,
        eddy_std_m_s=0.10,
        eddy_length_m=6000.0,
        changing_std_m_s=0.03,
        shear_std_m_s=0.05,
        shear_length_m=60.0,
        tide_std_m_s=(0.10,),
        reach_m=100_000.0,
    ),
    "tank": CurrentMapConfig(
        enabled=False,
        basin_std_m_s=0.01,
        eddy_std_m_s=0.01,
        eddy_length_m=1.0,
        changing_std_m_s=0.0,
        shear_std_m_s=0.0,
        shear_length_m=0.3,
        reach_m=14.0,
    ),
}
"""Settings as delivered, by the kind of site."""


def current_preset(site: Site) -> CurrentMapConfig:
    """Return the settings as delivered for a site, with a reach that goes with its domain."""
    domain = site.domain
    width_m = max(domain.x_max_m - domain.x_min_m, domain.y_max_m - domain.y_min_m)
    reach_m = max(_REACH_WIDTHS * width_m, 10.0)
    return CURRENT_PRESETS[site.kind].model_copy(update={"reach_m": reach_m})
