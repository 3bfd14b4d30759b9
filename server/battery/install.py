"""Puts the capability together."""

from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.battery import route
from server.battery.battery_use import BatteryUse
from server.fleet.fleet import Fleet
from server.link.event import ValuesStored

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Learn what robots draw from what they say of their batteries."""
    services, bus = foundation.services, foundation.bus
    batteries = services.add(BatteryUse(foundation, services.get(Fleet)))
    bus.subscribe(ValuesStored, batteries.take)

    def settings_changed(event: SettingsChanged) -> None:
        if event.kind == "battery":
            foundation.feed.mark("battery", event.robot)

    bus.subscribe(SettingsChanged, settings_changed)
    foundation.lifetime.on_start(batteries.start)
    foundation.lifetime.run("batteries", batteries.run)
