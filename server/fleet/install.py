"""Puts the capability together."""

from server.base.event_bus import AlarmChanged, EventLogged, SettingsChanged
from server.base.foundation import Foundation
from server.fleet import route, signing_route
from server.fleet.disabled_links import DisabledLinks
from server.fleet.event import LinkSwitched, RobotChanged, RobotReported
from server.fleet.fleet import Fleet
from server.fleet.panel import FleetViews
from server.fleet.roster import Roster
from server.fleet.view import to_the_public
from server.vehicle.vehicles import Vehicles
from server.water.event import WaterChanged

ROUTERS = (route.router, signing_route.router)


def install(foundation: Foundation) -> None:
    """Make the fleet, keep it as the database has it, and show it in the live stream."""
    bus, feed, services = foundation.bus, foundation.feed, foundation.services
    vehicles = services.get(Vehicles)
    fleet = services.add(Fleet(foundation.clock, bus, vehicles))
    views = services.add(
        FleetViews(fleet, vehicles, foundation.channels, foundation.alarms.worst_level)
    )
    roster = services.add(Roster(foundation, fleet))
    disabled_links = services.add(DisabledLinks(foundation.store, foundation.clock, bus))

    async def load() -> None:
        await disabled_links.load()
        fleet.set_disabled_links(disabled_links.disabled)
        await roster.load()

    def show(event: RobotReported) -> None:
        robot = event.robot
        feed.put(
            "robots",
            robot,
            lambda: views.live_view(robot),
            robot,
            public=lambda: to_the_public(views.live_view(robot)),
        )

    def show_alarm(event: AlarmChanged) -> None:
        robot = event.alarm.robot
        if robot is not None and fleet.knows(robot):
            fleet.touch(robot)

    bus.subscribe(RobotReported, show)
    bus.subscribe(RobotChanged, lambda _: feed.mark("robots"))
    bus.subscribe(AlarmChanged, show_alarm)
    bus.subscribe(LinkSwitched, lambda _: fleet.set_disabled_links(disabled_links.disabled))
    bus.subscribe(EventLogged, roster.event_logged)
    bus.subscribe(SettingsChanged, roster.settings_changed)
    bus.subscribe(WaterChanged, roster.water_changed)
    foundation.lifetime.on_load(load)
    foundation.lifetime.run("tracks of the past", roster.draw_tracks)
