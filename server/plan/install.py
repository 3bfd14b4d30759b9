"""Puts the capability together."""

import logging

from autonomy.warm_up import search_step
from server.access.rate import TokenLimits
from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.link.event import PlanQueueReported, PlanReported
from server.plan import route
from server.plan.battery import PlanBattery
from server.plan.dry_run import DryRuns
from server.plan.follow import PlanFollower
from server.plan.ledger import PlanLedger
from server.plan.machine_code import MachineCode
from server.plan.planning import Planning
from server.plan.state import PlanChanged, PlanSeen
from server.plan.task import LOAD_PLANNER

log = logging.getLogger(__name__)

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what plans, keeps plans, and moves them by what robots say."""
    foundation.services.get(Subjects).add_stored("plan")
    services, workers = foundation.services, foundation.workers
    fleet = services.get(Fleet)
    machine_code = MachineCode(foundation.jobs)
    ledger = services.add(PlanLedger(foundation, fleet))
    services.add(PlanBattery(foundation, fleet))
    planning = services.add(Planning(foundation, fleet, ledger, workers, machine_code))
    services.get(TokenLimits).add_work("plan", planning.is_under_way)
    follower = PlanFollower(foundation.store, ledger)

    def show(event: PlanChanged | PlanSeen) -> None:
        plan = event.plan
        foundation.feed.put("plans", plan.id, lambda: ledger.live_view(plan), plan.robot)

    bus = foundation.bus
    bus.subscribe(PlanChanged, ledger.take)
    bus.subscribe(PlanChanged, show)
    bus.subscribe(PlanChanged, planning.take)
    bus.subscribe(PlanSeen, show)
    foundation.changes.follow(PlanChanged, lambda event: event.plan.id)
    foundation.changes.follow(PlanSeen, lambda event: event.plan.id)
    bus.subscribe(RobotReported, lambda event: ledger.robot_changed(event.robot))
    bus.subscribe(PlanReported, lambda event: follower.take(event.report))
    bus.subscribe(PlanQueueReported, lambda event: follower.take_queue(event.queue))
    lifetime = foundation.lifetime
    lifetime.on_load(ledger.load)
    lifetime.on_stop(planning.stop)
    lifetime.run("waiting plans", ledger.watch_drafts)
    lifetime.run("plan reports", follower.run)
    lifetime.on_start(planning.resume)
    lifetime.run("planner's machine code", lambda: warm_up(fleet, workers, machine_code))


async def warm_up(fleet: Fleet, workers: WorkerPool, machine_code: MachineCode) -> None:
    """Compile what is not, and let a worker load the planner, so that nobody waits later."""
    await machine_code.prepare()
    await machine_code.wait_for(search_step("information_gain"), lambda _: None)
    try:
        await workers.run(LOAD_PLANNER, None)
        await DryRuns(fleet, workers).warm_up()
    except WORKER_FAILURES as error:
        log.warning("the planner could not be loaded ahead: %s", error)
