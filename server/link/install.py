"""Puts the capability together."""

from robot_link.standard_config import StandardCommandConfig
from robot_link.station.gateway.address import is_acoustic
from robot_link.transport.opening import is_radio
from robot_link.transport.shelf import Shelf
from server.access.subject import Subjects
from server.base.event_bus import ChannelsChanged, SettingsChanged
from server.base.foundation import Foundation
from server.fleet.disabled_links import DisabledLinks
from server.fleet.event import LinkSwitched, RobotChanged, RobotReported, SigningChanged, TrackGrew
from server.fleet.fleet import Fleet
from server.link import onboard_route, range_route, route, trial_route, waypoint_route
from server.link.channel_tables import ChannelTables
from server.link.derived import DerivedValues
from server.link.event import (
    DetectionsStored,
    PlanReported,
    RadiosChanged,
    SamplesStored,
    StateReported,
    TelemetryBridged,
    ValuesStored,
)
from server.link.figures import IntakeFigures
from server.link.ingest import Ingest
from server.link.moments import Moments
from server.link.parameters import Parameters
from server.link.radios import LinkFactory, Radios
from server.link.ranging import Ranging
from server.link.robot_figures import clock_offsets_s, figures_of
from server.link.robot_logs import RobotLogs
from server.link.signing import RobotSigning
from server.link.state_sums import StateSums
from server.link.trial_route import LinkTrials
from server.link.waypoints import Waypoints
from server.watch.station_clock import StationClock

ROUTERS = (
    range_route.router,
    route.router,
    onboard_route.router,
    waypoint_route.router,
    trial_route.router,
)


def install(foundation: Foundation, make_link: LinkFactory, shelf: Shelf) -> None:
    """Make what robots are heard and spoken to by: radios, acoustic modems, and the intake.

    Args:
        foundation: What the station stands on.
        make_link: Makes what serves the radios; where tests put their own.
        shelf: Where lines may be open already, and where they are left to a later process.
    """
    foundation.services.get(Subjects).add_details("log", "name")
    bus, clock, services = foundation.bus, foundation.clock, foundation.services
    fleet, disabled_links = services.get(Fleet), services.get(DisabledLinks)
    tables = services.add(ChannelTables(foundation, fleet))
    ingest = services.add(Ingest(foundation.store, fleet, clock, bus, foundation.channels, tables))
    derived = DerivedValues(fleet, clock, foundation.channels)
    signing = RobotSigning(foundation.secrets, clock)
    radios = services.add(Radios(clock, ingest.take, make_link, signing, shelf))
    ranging = services.add(Ranging(foundation, ingest.take))
    services.add(Parameters(foundation, fleet, radios))
    services.add(Waypoints(foundation, fleet, radios))
    services.add(RobotLogs(foundation, fleet, radios))
    services.add(LinkTrials())

    async def follow_fleet() -> None:
        await ranging.set_robots([status.record for status in fleet.statuses])

    async def learn_orders() -> None:
        for status in fleet.statuses:
            if status.record.is_foreign:
                robot = status.record.id
                found = await foundation.configurations.current("standard_commands", robot)
                radios.set_orders(robot, found.value_as(StandardCommandConfig))

    async def start() -> None:
        await tables.load()
        await learn_orders()
        radios.set_robots([status.record for status in fleet.statuses])
        for uri in disabled_links.disabled:
            switch(LinkSwitched(uri, is_enabled=False))
        await follow_fleet()
        for status in fleet.statuses:
            derived.look_at(status.record.id)

    async def stop() -> None:
        await ranging.stop()
        ingest.flush()

    def follow_radios() -> None:
        if radios.set_robots([status.record for status in fleet.statuses]):
            bus.publish(RadiosChanged())

    def signing_changed(event: SigningChanged) -> None:
        signing.decide_anew(event.robot)
        follow_radios()

    async def follow_orders() -> None:
        await learn_orders()
        follow_radios()

    def settings_changed(event: SettingsChanged) -> None:
        if event.kind == "standard_commands":
            foundation.background.start("orders to MAVLink vehicles", follow_orders())

    def robot_changed(_: RobotChanged) -> None:
        follow_radios()
        foundation.background.start("acoustic modems of the fleet", follow_fleet())

    def switch(event: LinkSwitched) -> None:
        if is_radio(event.uri):
            radios.set_enabled(event.uri, is_enabled=event.is_enabled)
        if is_acoustic(event.uri):
            ranging.set_enabled(event.uri, is_enabled=event.is_enabled)

    foundation.metrics.add(lambda: figures_of(fleet))
    services.get(StationClock).add_witness(lambda: clock_offsets_s(fleet))
    feed, grown = foundation.feed, set[str]()

    def stored(event: ValuesStored) -> None:
        feed.mark("samples", event.robot)
        if event.robot in grown:
            grown.discard(event.robot)
            feed.mark("track", event.robot)

    bus.subscribe(ChannelsChanged, lambda _: tables.catalogue_changed())
    bus.subscribe(TrackGrew, lambda event: grown.add(event.robot))
    bus.subscribe(ValuesStored, stored)

    def follow(event: SamplesStored) -> None:
        for robot in {sample.robot for sample in event.samples}:
            derived.look_at(robot)

    def acknowledge_bridged(event: TelemetryBridged) -> None:
        radios.acknowledge(event.samples)
        radios.acknowledge(event.heard)

    bus.subscribe(TelemetryBridged, acknowledge_bridged)
    bus.subscribe(SamplesStored, radios.acknowledge)
    bus.subscribe(DetectionsStored, radios.acknowledge)
    bus.subscribe(SamplesStored, follow)
    bus.subscribe(SamplesStored, IntakeFigures(foundation.metrics, clock).stored)
    bus.subscribe(RobotChanged, robot_changed)
    bus.subscribe(SettingsChanged, settings_changed)
    bus.subscribe(SigningChanged, signing_changed)
    bus.subscribe(LinkSwitched, switch)
    moments = Moments(foundation, fleet)
    bus.subscribe(StateReported, moments.take_state)
    bus.subscribe(PlanReported, moments.take_plan)
    bus.subscribe(RobotReported, lambda event: moments.robot_changed(event.robot))
    foundation.lifetime.on_load(moments.load)
    foundation.lifetime.run("moments of robots", moments.run)
    foundation.lifetime.on_stop(stop)
    foundation.lifetime.on_start(start)
    foundation.lifetime.run("derived channels", derived.run)
    foundation.lifetime.run("radio", radios.run)
    foundation.lifetime.run("sums of reports", StateSums(foundation).run)
