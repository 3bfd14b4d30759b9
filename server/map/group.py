"""The maps of robots that share one: the live one, and those of the newest comparison."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime

from autonomy.channel import Channel, ChannelCatalogue
from autonomy.field.config import FieldConfig
from autonomy.field.grid import Grid, grid_of
from autonomy.planner.config import PlannerConfig
from autonomy.site import Box, Site
from db.deployment_span import LiveSpan
from db.query.fleet.robots import RobotRecord
from robot_link.messages import Sample
from server.base.configuration import CurrentConfiguration
from server.fleet.water import Water
from server.map.record import Comparison
from server.map.site_map import SiteMap, basis_of
from server.map.view import ScoresView
from webui.scene.source import MapView

MapKey = tuple[str, str]
"""Variable and model."""


@dataclass(frozen=True, slots=True)
class MapSettings:
    """How the map of a robot is made."""

    config: FieldConfig
    """With the fidelity thresholds of the planner."""
    channel: Channel
    """What is mapped, as the catalogue has it."""
    domain: Box
    version: str
    """Public id of the version of the field's settings, ``preset`` for the preset."""
    threshold: float | None = None
    """What the map is held against, in the unit of its variable; it does not change the map."""


@dataclass(slots=True, eq=False)
class MapGroup:
    """One map and the robots that it is shown for; changed on one event loop only.

    Robots of one water whose settings differ have maps of their own, each of the samples of all.
    """

    water: Water
    site: Site
    is_simulated: bool
    config: FieldConfig
    channel: Channel
    domain: Box
    robots: tuple[str, ...]
    """Whose samples the map takes: all robots of the water."""
    spans: Mapping[str, LiveSpan] = field(default_factory=dict[str, LiveSpan])
    """The deployments whose samples these are, by robot; others of their robots stay out."""
    members: set[str] = field(default_factory=set[str])
    """Robots whose settings are these."""
    live: SiteMap | None = None
    """``None`` while it is being made."""
    waiting: list[Sample] = field(default_factory=list[Sample])
    comparison: Comparison | None = None
    scores: dict[MapKey, ScoresView] = field(default_factory=dict[MapKey, ScoresView])
    saved_version: int = 0
    saved_at: datetime | None = None
    is_stale: bool = False
    """Whether samples were located better since the map was made, or came in while it rested."""
    due_s: float = 0.0
    """When it may be made anew again, by the wall."""
    looked_s: float = -math.inf
    """When somebody asked for it last, by the wall."""

    @classmethod
    def of(cls, record: RobotRecord, settings: MapSettings, robots: tuple[str, ...]) -> "MapGroup":
        """Begin the group of a robot."""
        return cls(
            water=Water.of(record),
            site=record.site,
            is_simulated=record.simulated,
            config=settings.config,
            channel=settings.channel,
            domain=settings.domain,
            robots=robots,
        )

    def fits(self, record: RobotRecord, settings: MapSettings) -> bool:
        """Tell whether the map of a robot is this one."""
        return (self.water, self.site, self.config, self.channel, self.domain) == (
            Water.of(record),
            record.site,
            settings.config,
            settings.channel,
            settings.domain,
        )

    def is_fed_by(self, variable: str) -> bool:
        """Tell whether a measurement of a variable is a sample of the map."""
        return variable == self.config.variable

    def takes(self, sample: Sample) -> bool:
        """Tell whether a sample belongs to the map."""
        span = self.spans.get(sample.robot)
        return span is not None and span.holds(sample.measured_at)

    def grid(self) -> Grid:
        """Return the grid of the map, with its mask of the water."""
        return grid_of(self.config, self.domain, self.site)

    @property
    def basis(self) -> str:
        """Name of what the map is made of now."""
        live = self.live
        total, smoothed = (0, 0) if live is None else (live.total, live.smoothed)
        return basis_of(self.config, self.domain, total, smoothed)

    @property
    def views(self) -> Mapping[MapKey, MapView]:
        """Every map, the live one first; empty while it is being made."""
        live = self.live
        if live is None:
            return {}
        variable = self.config.variable
        shown = {(variable, live.view.model): live.view}
        compared = {} if self.comparison is None else self.comparison.views
        return shown | {key: view for key, view in compared.items() if key not in shown}


def field_config_of(
    found: CurrentConfiguration, planner: PlannerConfig, channels: ChannelCatalogue
) -> FieldConfig:
    """Return a field's settings with the planner's fidelity thresholds, where they fit.

    They have their channel's scale where they leave it to that.
    """
    value = found.value_as(FieldConfig)
    channel = channels.get(value.variable)
    if channel is not None:
        value = value.for_channel(channel)
    thresholds_m = planner.fidelity_thresholds_m
    if len(thresholds_m) != len(value.fidelity_thresholds_m):
        return value
    return value.with_thresholds(thresholds_m)
