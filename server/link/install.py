"""Puts the capability together."""

import asyncio

from robot_link.transport.shelf import Shelf
from server.access.subject import Subjects
from server.base.event_bus import ChannelsChanged
from server.base.foundation import Foundation
from server.fleet.event import RobotReported, TrackGrew
from server.fleet.fleet import Fleet
from server.link import onboard_route, range_route, route, trial_route, waypoint_route
from server.link.channel_tables import ChannelTables
from server.link.derived import DerivedValues
from server.link.event import (
    DetectionsStored,
    PlanReported,
    SamplesStored,
    StateReported,
    TelemetryBridged,
    ValuesStored,
)
from server.link.figures import IntakeFigures
from server.link.fleet_lines import FleetLines
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
    bus, clock, services = foundation.bus, foundation.clock, foundation.services
    services.get(Subjects).add_details("log", "name")
    fleet = services.get(Fleet)
    tables = services.add(ChannelTables(foundation, fleet))
    bus.subscribe(ChannelsChanged, lambda _: tables.catalogue_changed())
    ingest = services.add(Ingest(foundation.store, fleet, clock, bus, foundation.channels, tables))
    signing = RobotSigning(foundation.secrets, clock)
    radios = services.add(Radios(clock, ingest.take, make_link, signing, shelf))
    ranging = services.add(Ranging(foundation, ingest.take))
    lines = FleetLines(foundation, radios, ranging, signing)
    derived = DerivedValues(fleet, clock, foundation.channels)
    services.add(Parameters(foundation, fleet, radios))
    services.add(Waypoints(foundation, fleet, radios))
    services.add(RobotLogs(foundation, fleet, radios))
    services.add(LinkTrials())

    async def start() -> None:
        await tables.load()
        await lines.start()
        for status in fleet.statuses:
            derived.look_at(status.record.id)

    async def stop() -> None:
        await ranging.stop()
        ingest.flush()
        await asyncio.to_thread(signing.settle)

    _acknowledge(foundation, radios)
    _tell_pages(foundation)
    _follow_samples(foundation, derived)
    lines.subscribe()
    foundation.metrics.add(lambda: figures_of(fleet))
    services.get(StationClock).add_witness(lambda: clock_offsets_s(fleet))
    _install_moments(foundation, fleet)
    foundation.lifetime.on_stop(stop)
    foundation.lifetime.on_start(start)
    foundation.lifetime.run("derived channels", derived.run)
    foundation.lifetime.run("radio", radios.run)
    foundation.lifetime.run("sums of reports", StateSums(foundation).run)


def _acknowledge(foundation: Foundation, radios: Radios) -> None:
    """Acknowledge to robots what is kept, in the database or on the disk."""

    def acknowledge_bridged(event: TelemetryBridged) -> None:
        radios.acknowledge(event.samples)
        radios.acknowledge(event.heard)

    foundation.bus.subscribe(TelemetryBridged, acknowledge_bridged)
    foundation.bus.subscribe(SamplesStored, radios.acknowledge)
    foundation.bus.subscribe(DetectionsStored, radios.acknowledge)


def _tell_pages(foundation: Foundation) -> None:
    """Tell pages that there are new values and, once these are stored, a longer track."""
    feed, grown = foundation.feed, set[str]()

    def stored(event: ValuesStored) -> None:
        feed.mark("samples", event.robot)
        if event.robot in grown:
            grown.discard(event.robot)
            feed.mark("track", event.robot)

    foundation.bus.subscribe(TrackGrew, lambda event: grown.add(event.robot))
    foundation.bus.subscribe(ValuesStored, stored)


def _follow_samples(foundation: Foundation, derived: DerivedValues) -> None:
    def follow(event: SamplesStored) -> None:
        for robot in {sample.robot for sample in event.samples}:
            derived.look_at(robot)

    foundation.bus.subscribe(SamplesStored, follow)
    figures = IntakeFigures(foundation.metrics, foundation.clock)
    foundation.bus.subscribe(SamplesStored, figures.stored)


def _install_moments(foundation: Foundation, fleet: Fleet) -> None:
    moments = Moments(foundation, fleet)
    foundation.bus.subscribe(StateReported, moments.take_state)
    foundation.bus.subscribe(PlanReported, moments.take_plan)
    foundation.bus.subscribe(RobotReported, lambda event: moments.robot_changed(event.robot))
    foundation.lifetime.on_load(moments.load)
    foundation.lifetime.run("moments of robots", moments.run)
