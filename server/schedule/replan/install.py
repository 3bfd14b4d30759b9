"""Puts suggestions and contact windows together, as a part of what sends plans."""

from server.base.event_bus import EventLogged, SettingsChanged
from server.base.foundation import Foundation
from server.fleet.fleet import Fleet
from server.link.moments import CONTACT, DIVE_BEGUN, DIVE_ENDED, SURFACED
from server.map.field_maps import FieldMaps
from server.plan.ledger import PlanLedger
from server.plan.planning import Planning
from server.plan.state import PlanChanged
from server.schedule.replan.comparison import PlanComparison
from server.schedule.replan.contacts import Contacts
from server.schedule.replan.desk import SuggestionDesk
from server.schedule.replan.suggestions import Suggestions
from server.schedule.replan.told import SUGGESTED
from server.schedule.schedule import Schedule
from server.schedule.state import ScheduleChanged

_MOMENTS = (SURFACED, CONTACT, DIVE_BEGUN, DIVE_ENDED)


def install(foundation: Foundation) -> None:
    """Make what clocks contacts, and what suggests plans in them."""
    services, bus, feed = foundation.services, foundation.bus, foundation.feed
    fleet, ledger = services.get(Fleet), services.get(PlanLedger)
    schedule = services.get(Schedule)
    contacts = services.add(Contacts(foundation, fleet))
    suggestions = services.add(
        Suggestions(
            foundation,
            fleet,
            ledger,
            services.get(Planning),
            services.get(FieldMaps),
            schedule,
            contacts,
        )
    )
    services.add(PlanComparison(foundation, fleet, ledger, services.get(Planning)))
    services.add(SuggestionDesk(foundation, fleet, ledger, schedule, suggestions))

    def logged(event: EventLogged) -> None:
        kind, robot = event.event.kind, event.event.robot
        if kind in _MOMENTS:
            feed.mark("contact", robot)
        if kind in (*_MOMENTS, SUGGESTED):
            feed.mark("suggestion", robot)
        suggestions.take_event(event.event)

    def settings_changed(event: SettingsChanged) -> None:
        if event.kind == "automation":
            for status in fleet.statuses:
                feed.mark("suggestion", status.record.id)

    bus.subscribe(EventLogged, logged)
    bus.subscribe(PlanChanged, suggestions.take_plan)
    bus.subscribe(PlanChanged, lambda event: feed.mark("contact", event.plan.robot))
    bus.subscribe(ScheduleChanged, lambda event: feed.mark("suggestion", event.send.robot))
    bus.subscribe(SettingsChanged, settings_changed)
    foundation.lifetime.on_load(suggestions.load)
