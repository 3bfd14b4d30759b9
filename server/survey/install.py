"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.checklist.gate import StartGate
from server.command.state import SurfaceOrdered
from server.fleet.fleet import Fleet
from server.lease.hold import AutomationHold, HoldChanged
from server.link.event import PlanReported
from server.map.field_maps import FieldMaps
from server.plan.ledger import PlanLedger, PlanOutdated
from server.plan.planning import Planning
from server.plan.state import PlanChanged
from server.survey import mission_route, plan_route, route
from server.survey.fleet_survey import FleetSurveys
from server.survey.map_quality import SurveyMaps
from server.survey.mission_ledger import MissionChanged, MissionLedger
from server.survey.plan_choice import PlanChoices
from server.survey.step import SurveySteps
from server.survey.surveys import Surveys, stop_for
from server.transfer.transfers import Transfers

ROUTERS = (mission_route.router, route.router, plan_route.router)


def install(foundation: Foundation) -> None:
    """Make missions of several rounds, and let them go on by what plans and robots do."""
    subjects = foundation.services.get(Subjects)
    subjects.add_stored("mission")
    subjects.add_self_asking("POST", "/api/surveys")
    services, bus = foundation.services, foundation.bus
    fleet, plans = services.get(Fleet), services.get(PlanLedger)
    planning, transfers = services.get(Planning), services.get(Transfers)
    missions = services.add(MissionLedger(foundation, fleet))
    services.add(PlanChoices(foundation, fleet, plans, missions, planning))
    quality = SurveyMaps(
        foundation,
        fleet,
        missions,
        planning.problems,
        services.get(FieldMaps),
        foundation.workers,
    )
    steps = SurveySteps(foundation, fleet, missions, plans, planning, transfers, quality)
    surveys = services.add(
        Surveys(
            foundation,
            missions,
            planning,
            transfers,
            steps,
            services.get(StartGate),
            services.get(AutomationHold),
        )
    )
    services.add(FleetSurveys(fleet, surveys))

    def show(event: MissionChanged) -> None:
        view = missions.live_view(event.mission)
        foundation.feed.put("missions", event.mission, lambda: view, event.robot)

    def plan_reported(event: PlanReported) -> None:
        missions.robot_said_more(event.report.robot)
        surveys.robot_said_more(event.report.robot)

    bus.subscribe(PlanReported, plan_reported)
    bus.subscribe(HoldChanged, surveys.take_hold)
    bus.subscribe(PlanOutdated, lambda event: missions.robot_said_more(event.robot))
    bus.subscribe(PlanChanged, missions.plan_changed)
    bus.subscribe(MissionChanged, show)
    foundation.changes.follow(MissionChanged, lambda event: event.mission)
    bus.subscribe_within(SurfaceOrdered, stop_for)
    bus.subscribe(SurfaceOrdered, missions.surface_ordered)
    foundation.lifetime.on_load(missions.load)
    foundation.lifetime.on_stop(surveys.stop_all)
    foundation.lifetime.on_start(surveys.resume)
    foundation.lifetime.run("missions", missions.run)
    foundation.lifetime.run("surveys", surveys.run)
