"""Puts the capability together."""

from server.base.foundation import Foundation
from server.fleet.event import RobotChanged
from server.fleet.fleet import Fleet
from server.link.event import TargetReported
from server.link.ingest import Ingest
from server.plan.ledger import PlanLedger
from server.plan.planning import Planning
from server.target import route
from server.target.follow import TargetFollower
from server.target.planning import TargetPlanning

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what plans the pursuit of targets, and tells what becomes of them."""
    services = foundation.services
    fleet = services.get(Fleet)
    settings = services.get(Planning).settings
    services.add(TargetPlanning(foundation, fleet, services.get(PlanLedger), settings))
    follower = TargetFollower(foundation.store, services.get(Ingest).settle)

    async def load() -> None:
        for status in fleet.statuses:
            if status.target_report is not None:
                follower.take(status.target_report)

    def remember(event: RobotChanged) -> None:
        report = fleet.status(event.record.id).target_report
        if report is not None:
            follower.take(report)

    foundation.bus.subscribe(TargetReported, lambda event: follower.take(event.report))
    foundation.bus.subscribe(RobotChanged, remember)
    foundation.lifetime.on_load(load)
    foundation.lifetime.run("reports on targets", follower.run)
