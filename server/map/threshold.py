"""How much of the water is above a value, by draws of the whole field.

Neighbouring points of a map are wrong together, so the share follows from the probabilities at
single points no more than the size of a crowd from the chance of each to come. Fields are drawn
at the points of a coarse grid, once for a map that rests; any value is held against the same draws.
"""

import time
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.mask import water_mask
from autonomy.field.threshold import drawn_fields, level_of, share_above
from server.base.problem import conflict, not_found
from server.map.field_maps import FieldMaps
from server.map.group import MapGroup
from server.map.task_model import SCORING, domain_points
from server.map.view import ShareAboveView

DRAWS = 200
_REST_FACTOR = 20.0
"""Draws that took t are not made anew for this many t, however fast the map grows."""
_SEED = 5
"""The same draws of the same map, so that the share of a map that rests does not flicker."""


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """Fields that agree with a map."""

    fields: FloatArray
    """Shape ``(draws, points)``, in the model's scale."""
    version: int
    """Of the map."""
    updated_at: datetime | None
    due_s: float
    """When they may be made anew, by the wall."""


class ThresholdShares:
    """Tells how much of a robot's water is above a value. Belongs to one event loop."""

    def __init__(self, maps: FieldMaps) -> None:
        self._maps = maps
        self._draws: dict[str, tuple[MapGroup, Draws]] = {}
        """By robot, with the map that they are of."""

    async def share(self, robot: str, variable: str, above: float | None) -> ShareAboveView:
        """Return between which shares of the water the live map is above a value.

        Args:
            robot: Whose map.
            variable: The mapped quantity.
            above: The value, in its unit; ``None`` for the threshold of the field's settings.

        Raises:
            Problem: 404 without a live map of the variable, 409 without a value or for a map that
                states no covariance.
        """
        group = self._maps.group(robot)
        if group is None or group.live is None or group.config.variable != variable:
            raise not_found(f"There is no live map of {variable} of {robot}.")
        value = self._maps.threshold(robot) if above is None else above
        if value is None:
            raise conflict(
                "No threshold is set: name a value, or set one in the settings of the field map."
            )
        try:
            draws = await self._drawn(robot, group)
        except ValueError as error:
            raise conflict(f"The share cannot be told: {error}.") from error
        scale = group.config.resolved_scale()
        low, high = share_above(level_of(scale, value), draws.fields)
        return ShareAboveView(
            robot=robot,
            variable=variable,
            unit=group.live.view.variable.unit,
            above=value,
            low=low,
            high=high,
            draws=len(draws.fields),
            points=draws.fields.shape[1],
            updated_at=draws.updated_at,
        )

    async def _drawn(self, robot: str, group: MapGroup) -> Draws:
        known = self._draws.get(robot)
        view = None if group.live is None else group.live.view
        if known is not None and known[0] is group:
            is_newest = view is not None and known[1].version == view.version
            if is_newest or time.monotonic() < known[1].due_s:
                return known[1]
        began_s = time.monotonic()
        points = domain_points(group.domain, SCORING)
        wet = water_mask(group.site, points)
        found = await self._maps.predict(group, points[wet] if wet.any() else points)
        fields = drawn_fields(found.mean, found.covariance, DRAWS, np.random.default_rng(_SEED))
        ended_s = time.monotonic()
        draws = Draws(
            fields,
            -1 if view is None else view.version,
            None if view is None else view.updated_at,
            ended_s + _REST_FACTOR * (ended_s - began_s),
        )
        self._draws[robot] = (group, draws)
        return draws
