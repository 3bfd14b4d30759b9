"""The services of a running station by short names, as tests ask for them."""

from typing import get_type_hints

from robot_link.messages import RobotId
from server.base.foundation import Foundation
from server.command.commands import Commands
from server.current.currents import Currents
from server.fleet.disabled_links import DisabledLinks
from server.fleet.fleet import Fleet
from server.fleet.panel import FleetViews
from server.fleet.roster import Roster
from server.link.ingest import Ingest
from server.link.radios import Radios
from server.map.comparison import MapComparisons
from server.map.field_maps import FieldMaps
from server.map.learning import MapLearning
from server.map.opening import MapOpening
from server.plan.ledger import PlanLedger
from server.plan.planning import Planning
from server.satellite.gateways import Gateways
from server.satellite.satellite import Satellite
from server.scene.host import SceneHost
from server.study.identification import Identifications
from server.study.whatif import WhatIfs
from server.survey.mission_ledger import MissionLedger
from server.survey.surveys import Surveys
from server.target.planning import TargetPlanning
from server.transfer.transfers import Transfers
from server.vehicle.vehicles import Vehicles
from webui.scene.source import SceneSource


class OpenStation:
    """A station that runs, as its services."""

    commands: Commands
    comparisons: MapComparisons
    currents: Currents
    disabled_links: DisabledLinks
    fleet: Fleet
    views: FleetViews
    roster: Roster
    gateways: Gateways
    identifications: Identifications
    ingest: Ingest
    learning: MapLearning
    maps: FieldMaps
    opening: MapOpening
    missions: MissionLedger
    planning: Planning
    plans: PlanLedger
    radios: Radios
    satellite: Satellite
    scenes: SceneHost
    surveys: Surveys
    tracks: TargetPlanning
    transfers: Transfers
    vehicles: Vehicles
    whatifs: WhatIfs

    def __init__(self, foundation: Foundation) -> None:
        self.foundation = foundation
        self.feed = foundation.feed
        self.workers, self.study_workers = foundation.workers, foundation.study_workers
        for name, kind in get_type_hints(OpenStation).items():
            setattr(self, name, foundation.services.get(kind))

    async def refresh(self, robot: str) -> None:
        """Take a robot up as the database has it, and wait until its maps are open."""
        await self.roster.refresh(robot)
        await self.opening.open(self.fleet.status(robot).record)

    def scene_source(self, robot: RobotId) -> SceneSource | None:
        """Return what a robot's scene may draw, ``None`` for an unknown robot."""
        return self.scenes.source_of(robot)
