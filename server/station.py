"""One station: its capabilities in their order, opened one after another, closed in reverse."""

from collections.abc import AsyncGenerator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Protocol

from robot_link.transport.shelf import Shelf
from server.access import install as access
from server.access.access import Access
from server.alarm import install as alarm
from server.analysis import install as analysis
from server.backup import install as backup
from server.base.foundation import Foundation, open_foundation
from server.base.settings import Settings
from server.base_map import install as base_map
from server.battery import install as battery
from server.camera import install as camera
from server.checklist import install as checklist
from server.command import install as command
from server.current import install as current
from server.delivery import install as delivery
from server.demo import install as demo
from server.deployment import install as deployment
from server.design import install as design
from server.drive import install as drive
from server.fix import install as fix
from server.fleet import install as fleet
from server.lease import install as lease
from server.link import install as link
from server.link.radios import LinkFactory, open_link
from server.logbook import install as logbook
from server.map import install as maps
from server.notice import install as notice
from server.plan import install as plan
from server.prediction import install as prediction
from server.recording import install as recording
from server.replay import install as replay
from server.satellite import install as satellite
from server.satellite.gateways import Gateways
from server.satellite.install import GatewayFactory
from server.scene import install as scene
from server.schedule import install as schedule
from server.storage import install as storage
from server.study import install as study
from server.survey import install as survey
from server.system import install as system
from server.tag import install as tag
from server.target import install as target
from server.transfer import install as transfer
from server.vehicle import install as vehicle
from server.watch import install as watch
from server.water import install as water

CAPABILITIES = (
    access,
    watch,
    system,
    backup,
    demo,
    base_map,
    vehicle,
    water,
    camera,
    fleet,
    deployment,
    link,
    satellite,
    lease,
    command,
    drive,
    fix,
    current,
    maps,
    tag,
    battery,
    plan,
    design,
    checklist,
    transfer,
    schedule,
    target,
    survey,
    study,
    prediction,
    alarm,
    notice,
    scene,
    replay,
    recording,
    logbook,
    delivery,
    analysis,
    storage,
)
"""Each stands on those before it alone."""
ROUTERS = tuple(router for capability in CAPABILITIES for router in capability.ROUTERS)
"""Every route of a station."""


class Service(Protocol):
    """What runs on a foundation: a ``Station``, or a test's stand-in."""

    async def start(self) -> None:
        """Begin to work."""
        ...

    async def stop(self) -> None:
        """End all work."""
        ...


MakeService = Callable[[Foundation], Service]


class Station:
    """Everything that the station does for its robots; started once, stopped once.

    Belongs to one event loop. ``make_link`` and ``make_gateways`` are where tests put their own.
    """

    def __init__(
        self,
        foundation: Foundation,
        make_link: LinkFactory = open_link,
        make_gateways: GatewayFactory = Gateways,
        shelf: Shelf | None = None,
    ) -> None:
        self._lifetime = foundation.lifetime
        for first in (system, backup, demo, base_map, vehicle, water, camera, fleet, deployment):
            first.install(foundation)
        link.install(foundation, make_link, shelf or Shelf())
        satellite.install(foundation, make_gateways)
        for later in CAPABILITIES[CAPABILITIES.index(lease) :]:
            later.install(foundation)

    async def start(self) -> None:
        """Take up the fleet as the database knows it, and go on with what was under way."""
        await self._lifetime.start()

    async def stop(self) -> None:
        """Stop in the reverse order; everything under way goes on at the next start."""
        await self._lifetime.stop()


@dataclass(frozen=True, slots=True)
class RunningStation:
    """A station that is open for work."""

    foundation: Foundation
    station: Service
    first_code: str | None
    """Code that creates the first admin, while nobody can sign in."""


@asynccontextmanager
async def run_station(
    settings: Settings, make_service: MakeService
) -> AsyncGenerator[RunningStation]:
    """Open a station, and close it in reverse order when the block ends.

    Raises:
        StoreUnavailableError: If the database cannot be opened.
        NewerSchemaError: If a later version of the station wrote it.
    """
    async with AsyncExitStack() as stack:
        foundation = await open_foundation(settings, stack)
        access.install(foundation)
        watch.install(foundation)
        first_code = await foundation.services.get(Access).prepare()
        station = make_service(foundation)
        stack.push_async_callback(station.stop)
        await station.start()
        yield RunningStation(foundation, station, first_code)
