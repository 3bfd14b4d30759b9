"""Puts the capability together."""

from server.access.guard import Guard
from server.access.presence import Presence, PresenceChanged
from server.access.subject import Subjects
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.fleet.fleet import Fleet
from server.lease import route
from server.lease.ground_station import GroundStations
from server.lease.hold import AutomationHold, HoldChanged
from server.lease.leases import Leases
from server.lease.state import LeaseChanged
from server.link.event import ControlReported, ControlRequested
from server.link.radios import Radios

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what knows who is in charge, and the switch that holds automation."""
    services, bus = foundation.services, foundation.bus
    presence = services.get(Presence)
    leases = services.add(Leases(foundation, services.get(Fleet), presence))
    stations = services.add(
        GroundStations(foundation, leases, services.get(Radios), services.get(Fleet))
    )
    hold = services.add(AutomationHold(foundation))

    def switched(event: HoldChanged) -> None:
        hold.take_change(event)
        foundation.feed.mark("automation")

    def settings_changed(event: SettingsChanged) -> None:
        leases.take_settings(event)
        if event.kind == "lease":
            stations.settings_changed()

    guard = services.get(Guard)
    guard.add_check(leases.check)
    guard.add_script_check(hold.refuse)
    for path in (("POST", "/api/leases/release"), ("PUT", "/api/automation")):
        services.get(Subjects).add_self_asking(*path)
    bus.subscribe(LeaseChanged, leases.take_change)
    bus.subscribe(PresenceChanged, leases.take_presence)
    bus.subscribe(LeaseChanged, stations.take_lease)
    bus.subscribe(ControlReported, stations.take_report)
    bus.subscribe(ControlRequested, stations.take_request)
    bus.subscribe(SettingsChanged, settings_changed)
    bus.subscribe(HoldChanged, switched)
    foundation.lifetime.on_load(leases.load)
    foundation.lifetime.on_load(hold.load)
    foundation.lifetime.run("leases", leases.run)
    foundation.lifetime.run("other ground stations", stations.run)
