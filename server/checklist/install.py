"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.event_bus import EventLogged, SettingsChanged
from server.base.foundation import Foundation
from server.checklist import route, template_route
from server.checklist.checklists import Checklists
from server.checklist.gate import StartGate
from server.checklist.overview import Overview
from server.checklist.state import ChecklistChanged
from server.checklist.templates import Templates, TemplatesChanged
from server.deployment.deployments import Deployments
from server.fleet.fleet import Fleet
from server.fleet.panel import FleetViews

ROUTERS = (route.router, template_route.router)


def install(foundation: Foundation) -> None:
    """Make the checklists, and the gate that every start passes."""
    foundation.services.get(Subjects).add_stored("checklist")
    services, bus, feed = foundation.services, foundation.bus, foundation.feed
    fleet = services.get(Fleet)
    templates = services.add(Templates(foundation))
    checklists = services.add(Checklists(foundation, fleet, services.get(FleetViews), templates))
    services.add(Overview(foundation, checklists))
    gate = services.add(StartGate(foundation, fleet, checklists))
    services.get(Deployments).set_gate(gate.look_at_launch)

    def mark_all() -> None:
        for status in fleet.statuses:
            feed.mark("checklists", status.record.id)

    def changed(event: ChecklistChanged) -> None:
        checklists.wake(event.run.robot)
        feed.mark("checklists", event.run.robot)

    def templates_changed(_: TemplatesChanged) -> None:
        feed.mark("checklist-templates")
        mark_all()

    def settings_changed(event: SettingsChanged) -> None:
        if event.kind == "checklist":
            mark_all()

    def logged(event: EventLogged) -> None:
        if event.event.kind.startswith("deployment."):
            checklists.wake(event.event.robot)

    bus.subscribe(ChecklistChanged, changed)
    bus.subscribe(TemplatesChanged, templates_changed)
    bus.subscribe(SettingsChanged, settings_changed)
    bus.subscribe(EventLogged, logged)
    foundation.lifetime.on_load(templates.load)
    foundation.lifetime.on_load(checklists.load)
    foundation.lifetime.run("checklists", checklists.run)
