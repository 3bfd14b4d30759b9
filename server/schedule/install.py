"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.event_bus import EventLogged, SettingsChanged
from server.base.foundation import Foundation
from server.command.state import SurfaceOrdered
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.fleet.panel import FleetViews
from server.lease.hold import AutomationHold, HoldChanged
from server.plan.ledger import PlanLedger
from server.plan.state import PlanChanged
from server.schedule import route
from server.schedule.replan import install as replan
from server.schedule.replan import route as replan_route
from server.schedule.schedule import Schedule
from server.schedule.state import ScheduleChanged, purge_for
from server.transfer.state import TransferChanged
from server.transfer.transfers import Transfers

ROUTERS = (route.router, replan_route.router)


def install(foundation: Foundation) -> None:
    """Make what sends plans by itself, and what drops them."""
    foundation.services.get(Subjects).add_stored("schedule_id", "schedule")
    services, bus = foundation.services, foundation.bus
    fleet = services.get(Fleet)
    schedule = services.add(
        Schedule(
            foundation,
            fleet,
            services.get(FleetViews),
            services.get(PlanLedger),
            services.get(Transfers),
            services.get(AutomationHold),
        )
    )

    def changed(event: ScheduleChanged) -> None:
        schedule.take(event.send)
        foundation.feed.mark("schedule", event.send.robot)

    def settings_changed(event: SettingsChanged) -> None:
        if event.kind == "automation":
            for status in fleet.statuses:
                schedule.wake(status.record.id)

    bus.subscribe(ScheduleChanged, changed)
    bus.subscribe(HoldChanged, lambda _: schedule.wake_all())
    bus.subscribe(SettingsChanged, settings_changed)
    bus.subscribe(RobotReported, lambda event: schedule.wake(event.robot))
    bus.subscribe(EventLogged, lambda event: schedule.wake(event.event.robot))
    bus.subscribe(PlanChanged, lambda event: schedule.wake(event.plan.robot))
    bus.subscribe(TransferChanged, lambda event: schedule.wake(event.transfer.robot))
    bus.subscribe_within(SurfaceOrdered, purge_for)
    foundation.lifetime.on_load(schedule.load)
    foundation.lifetime.run("schedule", schedule.run)
    replan.install(foundation)
