"""Where a robot works: the water body, its frame, and the part of it that may be explored."""

from typing import Literal, Self

from pydantic import model_validator

from autonomy.configuration import Configuration, quantity


class Box(Configuration):
    """An axis-aligned box in the site's NED frame; depth is positive down from the surface."""

    x_min_m: float = quantity(0.0, "m", title="South edge (x)")
    """Smallest northing of the box in the site frame."""
    x_max_m: float = quantity(2.75, "m", title="North edge (x)")
    """Largest northing of the box in the site frame."""
    y_min_m: float = quantity(0.0, "m", title="West edge (y)")
    """Smallest easting of the box in the site frame."""
    y_max_m: float = quantity(1.37, "m", title="East edge (y)")
    """Largest easting of the box in the site frame."""
    depth_max_m: float = quantity(0.65, "m", title="Deepest", gt=0.0)
    """Greatest depth; the box always begins at the surface."""

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        if self.x_max_m <= self.x_min_m:
            raise ValueError("x_max_m must exceed x_min_m")
        if self.y_max_m <= self.y_min_m:
            raise ValueError("y_max_m must exceed y_min_m")
        return self

    def contains(self, x_m: float, y_m: float, z_m: float, margin_m: float = 0.0) -> bool:
        """Tell whether a point is inside the box, or within ``margin_m`` outside of it."""
        return (
            self.x_min_m - margin_m <= x_m <= self.x_max_m + margin_m
            and self.y_min_m - margin_m <= y_m <= self.y_max_m + margin_m
            and -margin_m <= z_m <= self.depth_max_m + margin_m
        )

    def is_inside(self, outer: "Box") -> bool:
        """Tell whether no part of this box leaves ``outer``."""
        return outer.contains(self.x_min_m, self.y_min_m, 0.0) and outer.contains(
            self.x_max_m, self.y_max_m, self.depth_max_m
        )


class Site(Configuration):
    """A water body with a local NED frame; the frame's origin lies at the surface."""

    name: str
    """What operators call the place."""
    kind: Literal["tank", "lake", "sea"]
    """Shape of the surroundings in the 3D view; walls exist in a tank only."""
    water: Box
    """All the water: walls or shore, and the floor. No plan may leave it."""
    domain: Box
    """The part to explore: the default domain of a survey."""
    origin_latitude_deg: float
    """WGS84 latitude of the frame's origin."""
    origin_longitude_deg: float
    """WGS84 longitude of the frame's origin."""
    radio_under_water: bool
    """Whether radio reaches a submerged robot (a shallow tank) or only a surfaced one."""
    variable: str
    """The field that a survey maps here, a key of ``autonomy.field.variable``."""


TANK = Site(
    name="Test tank",
    kind="tank",
    water=Box(x_min_m=-0.925, x_max_m=3.675, y_min_m=-0.865, y_max_m=2.235, depth_max_m=1.2),
    domain=Box(),
    origin_latitude_deg=42.7251,
    origin_longitude_deg=-84.4791,
    radio_under_water=True,
    variable="blue_light",
)
"""The thesis's tank, 4.6 x 3.1 x 1.2 m, around its exploration domain (thesis 5.5.1)."""

LAKE = Site(
    name="Practice lake",
    kind="lake",
    water=Box(x_min_m=0.0, x_max_m=500.0, y_min_m=0.0, y_max_m=500.0, depth_max_m=20.0),
    domain=Box(x_min_m=40.0, x_max_m=460.0, y_min_m=40.0, y_max_m=460.0, depth_max_m=16.0),
    origin_latitude_deg=42.7600,
    origin_longitude_deg=-84.3800,
    radio_under_water=False,
    variable="chlorophyll",
)
"""A lake of 500 x 500 x 20 m for GRACE 3 (field of the specification's synthetic chlorophyll)."""
