"""What robots say of the plans on board moves the station's plans, and nothing else does."""

from dataclasses import asdict
from datetime import timedelta

from db.query.plans import PlanRecord, plan_by_hash
from db.query.telemetry import newest_plan_report
from db.store import Store
from robot_link.messages import SURFACED_BY_COMMAND, OnboardPlanState, PlanReport
from server.base.retry_queue import RetryQueue
from server.fleet.status import FOLLOW_TARGET
from server.fleet.words import TEACHING
from server.plan.document import onboard_by, teaches
from server.plan.ledger import ON_THE_WAY, PlanLedger
from server.plan.view import OnboardView

_STATES = {
    OnboardPlanState.ON_BOARD: "on_board",
    OnboardPlanState.RUNNING: "running",
    OnboardPlanState.DONE: "done",
    OnboardPlanState.FAILED: "failed",
}
_BEFORE = {
    "on_board": ("draft", "sent"),
    "running": ("draft", "sent", "on_board"),
    **dict.fromkeys(("done", "failed", "cancelled"), ("draft", "sent", "on_board", "running")),
}
"""States from which a robot's word leads on; reports may be missed, but never lead back."""
_ROUNDED = timedelta(seconds=2)
"""What the times of two words of a robot may be off, one of them by satellite."""
_OVERSPENT = 0.05
"""Energy units beyond the account that are worth a word."""


class PlanFollower:
    """Turns plan reports into states of plans, in order. Belongs to one event loop."""

    def __init__(self, store: Store, ledger: PlanLedger) -> None:
        self._store = store
        self._ledger = ledger
        self._queue = RetryQueue("plan reports")
        self._heard: dict[str, tuple[str | None, OnboardPlanState]] = {}
        self._flying: dict[str, PlanReport] = {}
        """The newest of each robot that said that it flies a plan."""

    async def run(self) -> None:
        """Follow until cancelled."""
        await self._queue.run()

    def take(self, report: PlanReport) -> None:
        """Take a report; robots repeat themselves, and only news is worked on."""
        if report.state is OnboardPlanState.RUNNING:
            self._flying[report.robot] = report
        news = (report.sha256, report.state)
        if self._heard.get(report.robot) != news:
            self._heard[report.robot] = news
            self._queue.add(lambda: self._follow(report))
        self._ledger.robot_said_more(report.robot)

    async def _follow(self, report: PlanReport) -> None:
        state = _state_of(report)
        if state is None or report.sha256 is None:
            await self._lost(report)
            return
        sha256 = report.sha256
        plan = await self._store.query(lambda session: plan_by_hash(session, report.robot, sha256))
        if plan is not None and plan.state in _BEFORE[state]:
            await self._advance(plan, state, report)
        elif plan is not None and (plan.state, state) == ("running", "on_board"):
            await self._interrupted(plan, report)
        await self._supersede(report, None if plan is None else plan.id)

    async def _advance(self, plan: PlanRecord, state: str, report: PlanReport) -> None:
        onboard = onboard_by(plan, report)
        mark = f" ({TEACHING})" if teaches(plan) else ""
        text = {
            "on_board": f"{plan.robot} has {plan.id} on board.",
            "running": f"{plan.robot} flies {plan.id}{mark}.",
            "done": f"{plan.robot} {_completed(plan)}{_overspending(onboard)}.",
            "failed": f"{plan.robot} ended {plan.id} early: {report.reason or 'no reason given'}",
            "cancelled": f"{plan.robot} came up as ordered; that ended {plan.id}.",
        }[state]
        document: dict[str, object] = {"onboard": asdict(onboard)}
        if state in {"failed", "cancelled"}:
            document["message"] = text
        if state in {"running", "done"}:
            on_board = f"{plan.robot} has {plan.id} on board."
            await self._ledger.advance(plan.id, "on_board", on_board, only_from=_BEFORE["on_board"])
        await self._ledger.advance(
            plan.id, state, text, only_from=_BEFORE[state], document=document
        )

    async def _interrupted(self, plan: PlanRecord, report: PlanReport) -> None:
        """End a plan that waits on board again: its robot was switched off while it flew it."""
        flown = self._flying.get(plan.robot)
        if flown is None or flown.sha256 != plan.sha256:
            flown = await self._store.query(
                lambda session: newest_plan_report(session, plan.robot, flying=report.sha256)
            )
        if flown is None or report.measured_at <= flown.measured_at + _ROUNDED:
            return  # an older word that took longer
        text = f"{plan.robot} was switched off while it flew {plan.id}, and flies it no longer."
        await self._end(plan, "failed", text, onboard=asdict(onboard_by(plan, flown)))

    async def _supersede(self, report: PlanReport, holder: str | None) -> None:
        """End the plans that the robot no longer holds, now that it names another."""
        for plan in await self._ledger.of_robot(report.robot, ("on_board", "running")):
            came_later = plan.on_board_at is not None and plan.on_board_at > report.received_at
            if plan.id != holder and not came_later:
                text = f"{plan.robot} holds another plan now; {plan.id} ended."
                await self._end(plan, "superseded", text)

    async def _lost(self, report: PlanReport) -> None:
        """End the plans of a robot that says it holds none."""
        if report.state is not OnboardPlanState.NONE:
            return
        for plan in await self._ledger.of_robot(report.robot, ("on_board", "running")):
            await self._end(plan, "failed", f"{plan.robot} says that it no longer holds {plan.id}.")

    async def _end(self, plan: PlanRecord, state: str, text: str, **more: object) -> None:
        await self._ledger.advance(
            plan.id, state, text, only_from=ON_THE_WAY, document={"message": text, **more}
        )


def _state_of(report: PlanReport) -> str | None:
    """Return the state that a report brings a plan into; a person's order is no failure."""
    if report.state is OnboardPlanState.FAILED and report.reason == SURFACED_BY_COMMAND:
        return "cancelled"
    return _STATES.get(report.state)


def _completed(plan: PlanRecord) -> str:
    """Return what a robot did that reached a plan's end: only time ends a pursuit as planned."""
    if plan.kind == FOLLOW_TARGET:
        return f"followed the target of {plan.id} until its time was over"
    return f"flew {plan.id} to its end"


def _overspending(onboard: OnboardView) -> str:
    if onboard.overspent < _OVERSPENT:
        return ""
    return (
        f" and used {onboard.energy_used:.1f} energy units, "
        f"{onboard.overspent:.1f} more than planned"
    )
