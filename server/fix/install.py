"""Puts the capability together."""

from robot_link.camera.config import CameraConfig
from server.base.foundation import Foundation
from server.camera.event import PictureSeen, RigChanged
from server.camera.processes import CameraProcesses
from server.camera.rig import CameraRig
from server.fix import route
from server.fix.event import FixesStored, FixFound
from server.fix.follow import FixFollowing
from server.fix.fusion import Fusion
from server.fix.records import FixRecords
from server.fleet.disabled_links import DisabledLinks
from server.fleet.fleet import Fleet
from server.link.event import StateReported
from server.link.radios import Radios

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Find robots in what cameras see, keep where they were, and tell them."""
    services, bus, lifetime = foundation.services, foundation.bus, foundation.lifetime
    fleet = services.get(Fleet)
    processes = services.get(CameraProcesses)

    def config() -> CameraConfig:
        return processes.config

    fusion = services.add(
        Fusion(foundation, fleet, services.get(DisabledLinks), services.get(CameraRig), config)
    )
    records = services.add(FixRecords(foundation.store, foundation.clock, bus, fleet))
    following = services.add(
        FixFollowing(foundation, fleet, fusion, records, services.get(Radios), config)
    )
    bus.subscribe(PictureSeen, fusion.take)
    bus.subscribe(RigChanged, lambda _: fusion.rig_changed())
    bus.subscribe(FixFound, records.take)
    bus.subscribe(FixFound, following.take_fix)
    bus.subscribe(StateReported, following.take_state)
    bus.subscribe(FixesStored, lambda event: foundation.feed.mark("fixes", event.robot))
    lifetime.on_stop(records.flush)
    lifetime.on_stop(fusion.stop)
    lifetime.run("fixes that were sent", records.run)
    lifetime.run("disagreements with cameras", following.run)
    lifetime.run("links by cameras", fusion.tell)
    lifetime.run("fusion", fusion.run)
