"""Puts the capability together."""

from server.base.foundation import Foundation
from server.current.currents import Currents
from server.fleet.event import FixTaken, RobotChanged
from server.fleet.fleet import Fleet
from server.link.event import SamplesStored
from server.map import route
from server.map.comparison import MapComparisons
from server.map.event import MapChanged
from server.map.field_maps import FieldMaps
from server.map.learning import MapLearning
from server.map.opening import MapOpening
from server.map.threshold import ThresholdShares

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make the field maps of every robot, and let samples and fixes into them."""
    bus, services, workers = foundation.bus, foundation.services, foundation.study_workers
    fleet = services.get(Fleet)
    currents = services.get(Currents)
    maps = services.add(FieldMaps(foundation.store, foundation.clock, bus, currents.usable))
    services.add(ThresholdShares(maps))
    opening = services.add(MapOpening(foundation, maps))
    services.add(MapComparisons(foundation, fleet, maps, workers))
    services.add(MapLearning(foundation, fleet, maps, workers))

    async def start() -> None:
        for status in list(fleet.statuses):
            opening.begin(status.record)

    bus.subscribe(SamplesStored, maps.feed)
    bus.subscribe(FixTaken, maps.take_fix)
    bus.subscribe(MapChanged, lambda event: foundation.feed.mark("maps", event.robot))
    bus.subscribe(RobotChanged, lambda event: opening.begin(event.record))
    foundation.lifetime.run("field maps", maps.run)
    foundation.lifetime.on_start(start)
