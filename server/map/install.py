"""Puts the capability together."""

import logging

from db.fault import StoreError
from server.access.subject import Subjects
from server.base.event_bus import ChannelsChanged, EventLogged
from server.base.foundation import Foundation
from server.current.currents import Currents
from server.fleet.event import FixTaken, RobotChanged
from server.fleet.fleet import Fleet
from server.link.event import SamplesStored
from server.map import route
from server.map.choice import MapChoices
from server.map.comparison import MapComparisons
from server.map.event import MapChanged
from server.map.field_maps import FieldMaps
from server.map.learning import MapLearning
from server.map.opening import MapOpening
from server.map.threshold import ThresholdShares

log = logging.getLogger(__name__)

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make the field maps of every robot, and let samples and fixes into them."""
    foundation.services.get(Subjects).add_details("variable")
    bus, services, workers = foundation.bus, foundation.services, foundation.study_workers
    fleet = services.get(Fleet)
    currents = services.get(Currents)
    maps = services.add(
        FieldMaps(foundation.store, foundation.clock, bus, foundation.channels, currents.carrier)
    )
    foundation.metrics.add(maps.figures)
    services.add(ThresholdShares(maps))
    services.add(MapChoices(foundation, fleet))
    opening = services.add(MapOpening(foundation, maps))
    services.add(MapComparisons(foundation, fleet, maps, workers))
    services.add(MapLearning(foundation, fleet, maps, workers))

    async def start() -> None:
        for status in list(fleet.statuses):
            opening.begin(status.record)

    def channel_changed(event: ChannelsChanged) -> None:
        """Show maps as the catalogue has their channel now."""
        for status in list(fleet.statuses):
            group = maps.group(status.record.id)
            if group is not None and group.channel.key == event.key:
                opening.begin(status.record)

    async def keep(robot: str) -> None:
        try:
            await maps.settle(robot)
        except StoreError as error:
            log.warning("the last map of %s was not kept: %s", robot, error)

    def event_logged(logged: EventLogged) -> None:
        event = logged.event
        if event.kind == "deployment.ended" and event.robot is not None:
            foundation.background.start(f"last map of {event.robot}", keep(event.robot))

    bus.subscribe(EventLogged, event_logged)
    bus.subscribe(SamplesStored, maps.feed)
    bus.subscribe(FixTaken, maps.take_fix)
    bus.subscribe(MapChanged, lambda event: foundation.feed.mark("maps", event.robot))
    bus.subscribe(RobotChanged, lambda event: opening.begin(event.record))
    bus.subscribe(ChannelsChanged, channel_changed)
    foundation.lifetime.run("field maps", maps.run)
    foundation.lifetime.on_start(start)
