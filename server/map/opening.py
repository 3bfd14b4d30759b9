"""Opens the maps of robots, and again when their settings or their water changed."""

import asyncio
import logging

from autonomy.planner.config import PlannerConfig
from db.fault import StoreError
from db.query.fleet.robots import RobotRecord
from server.base.foundation import Foundation
from server.map.field_maps import FieldMaps
from server.map.group import MapSettings, field_config_of

log = logging.getLogger(__name__)


class MapOpening:
    """Opens one map at a time, with the settings that hold then. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, maps: FieldMaps) -> None:
        self._foundation = foundation
        self._maps = maps
        self._turn = asyncio.Lock()
        """Whoever waits reads the settings after who went before, so the newest are shown."""

    def begin(self, robot: RobotRecord) -> None:
        """Open the maps of a robot in the background."""
        self._foundation.background.start(f"maps of {robot.id}", self._open_or_tell(robot))

    async def open(self, robot: RobotRecord) -> None:
        """Open the maps of a robot; those of a recording are shown as they were kept."""
        if robot.kind == "recorded":
            await self._maps.show_saved(robot.id)
            return
        async with self._turn:
            book = self._foundation.configurations
            planner = (await book.current("planner", robot.id)).value_as(PlannerConfig)
            found = await book.current("field", robot.id)
            channels = self._foundation.channels.catalogue
            config = field_config_of(found, planner, channels)
            settings = MapSettings(
                config=config.model_copy(update={"threshold": None}),
                channel=channels[config.variable],
                domain=planner.domain,
                version=found.id or "preset",
                threshold=config.threshold,
            )
            await self._maps.open(robot, settings)

    async def _open_or_tell(self, robot: RobotRecord) -> None:
        try:
            await self.open(robot)
        except StoreError as error:
            log.warning("the maps of %s were not opened: %s", robot.id, error)
