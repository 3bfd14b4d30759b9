"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.checklist.gate import StartGate
from server.command.commands import Commands
from server.command.state import SurfaceOrdered
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.link.event import UploadReported
from server.link.radios import Radios
from server.plan.ledger import PlanLedger
from server.satellite.satellite import Satellite
from server.transfer import route
from server.transfer.machine import TransferServices
from server.transfer.state import TransferChanged, withdraw_for
from server.transfer.transfers import Transfers

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what brings plans on board."""
    foundation.services.get(Subjects).add_stored("transfer")
    services, bus, feed = foundation.services, foundation.bus, foundation.feed
    needed = TransferServices(
        foundation,
        services.get(Fleet),
        services.get(PlanLedger),
        services.get(Commands),
        services.get(Radios),
        services.get(Satellite),
    )
    transfers = services.add(Transfers(needed, services.get(StartGate)))

    def show(event: TransferChanged) -> None:
        view = event.transfer
        feed.put("transfers", view.id, lambda: view, view.robot)

    bus.subscribe_within(SurfaceOrdered, withdraw_for)
    bus.subscribe(SurfaceOrdered, lambda event: transfers.stop_for(event.robot))
    bus.subscribe(UploadReported, lambda event: transfers.take_upload(event.report))
    bus.subscribe(RobotReported, lambda event: transfers.robot_changed(event.robot))
    bus.subscribe(TransferChanged, show)
    foundation.changes.follow(TransferChanged, lambda event: event.transfer.id)
    foundation.lifetime.on_stop(transfers.stop)
    foundation.lifetime.on_start(transfers.resume)
    foundation.lifetime.run("transfers", transfers.run)
