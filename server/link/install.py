"""Puts the capability together."""

from robot_link.station.gateway.address import is_acoustic
from robot_link.transport.opening import is_radio
from server.base.foundation import Foundation
from server.fleet.disabled_links import DisabledLinks
from server.fleet.event import LinkSwitched, RobotChanged, SigningChanged, TrackGrew
from server.fleet.fleet import Fleet
from server.link import onboard_route, range_route, route
from server.link.event import RadiosChanged, SamplesStored, ValuesStored
from server.link.ingest import Ingest
from server.link.parameters import Parameters
from server.link.radios import LinkFactory, Radios
from server.link.ranging import Ranging
from server.link.robot_logs import RobotLogs
from server.link.signing import RobotSigning

ROUTERS = (range_route.router, route.router, onboard_route.router)


def install(foundation: Foundation, make_link: LinkFactory) -> None:
    """Make what robots are heard and spoken to by: radios, acoustic modems, and the intake.

    Args:
        foundation: What the station stands on.
        make_link: Makes what serves the radios; where tests put their own.
    """
    bus, clock, services = foundation.bus, foundation.clock, foundation.services
    fleet, disabled_links = services.get(Fleet), services.get(DisabledLinks)
    ingest = services.add(Ingest(foundation.store, fleet, clock, bus))
    signing = RobotSigning(foundation.secrets, clock)
    radios = services.add(Radios(clock, ingest.take, make_link, signing))
    ranging = services.add(Ranging(foundation, ingest.take))
    services.add(Parameters(foundation, fleet, radios))
    services.add(RobotLogs(foundation, fleet, radios))

    async def follow_fleet() -> None:
        await ranging.set_robots([status.record for status in fleet.statuses])

    async def start() -> None:
        radios.set_robots([status.record for status in fleet.statuses])
        for uri in disabled_links.disabled:
            switch(LinkSwitched(uri, is_enabled=False))
        await follow_fleet()

    async def stop() -> None:
        await ranging.stop()
        ingest.flush()

    def follow_radios() -> None:
        if radios.set_robots([status.record for status in fleet.statuses]):
            bus.publish(RadiosChanged())

    def signing_changed(event: SigningChanged) -> None:
        signing.decide_anew(event.robot)
        follow_radios()

    def robot_changed(_: RobotChanged) -> None:
        follow_radios()
        foundation.background.start("acoustic modems of the fleet", follow_fleet())

    def switch(event: LinkSwitched) -> None:
        if is_radio(event.uri):
            radios.set_enabled(event.uri, is_enabled=event.is_enabled)
        if is_acoustic(event.uri):
            ranging.set_enabled(event.uri, is_enabled=event.is_enabled)

    feed, grown = foundation.feed, set[str]()

    def stored(event: ValuesStored) -> None:
        feed.mark("samples", event.robot)
        if event.robot in grown:
            grown.discard(event.robot)
            feed.mark("track", event.robot)

    bus.subscribe(TrackGrew, lambda event: grown.add(event.robot))
    bus.subscribe(ValuesStored, stored)
    bus.subscribe(SamplesStored, radios.acknowledge)
    bus.subscribe(RobotChanged, robot_changed)
    bus.subscribe(SigningChanged, signing_changed)
    bus.subscribe(LinkSwitched, switch)
    foundation.lifetime.on_stop(stop)
    foundation.lifetime.on_start(start)
    foundation.lifetime.run("radio", radios.run)
