"""What a message from a robot says: pure functions from bytes to values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime

from robot_link.messages import (
    OnboardPlanState,
    PlanHash,
    PlanQueue,
    PlanReport,
    RobotId,
    SystemId,
)
from robot_link.report import SatelliteReport
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import TransferId
from robot_link.satellite.content import (
    MobileOriginatedContent,
    Reason,
    ShortPlanReport,
    TransferAck,
    is_waiting,
)
from robot_link.satellite.frame import WireError
from robot_link.satellite.record import read_mobile_originated
from robot_link.station.gateway.gateway import MobileOriginated

_OUTCOMES = {
    CommandOutcome.DONE: "obeyed",
    CommandOutcome.NOT_NOW: "not obeyed now",
    CommandOutcome.WRONG_PLAN: "not obeyed: another plan is on board",
    CommandOutcome.UNSUPPORTED: "not known to the robot",
}
FindPlan = Callable[[str], PlanHash | None]
"""Returns the full hash of a plan that the station knows by its first digits."""
FindTransfer = Callable[[TransferId], PlanHash | None]
"""Returns the hash of a plan that the station knows by the name of its transfer."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One message, read or not."""

    content: MobileOriginatedContent | None
    """``None`` for an empty message, and for one that cannot be read."""
    fault: str
    """Why it cannot be read; empty if it can."""
    text: str
    """What it says, in one sentence."""


def read(message: MobileOriginated, key: bytes, system: SystemId, robot: RobotId) -> Reading:
    """Read a message; one that cannot be read is no error, but says so."""
    if message.fault:
        return Reading(None, message.fault, message.fault)
    if not message.data:
        return Reading(None, "", "An empty message: the modem asked for what waits for it.")
    try:
        content = read_mobile_originated(message.data, key, system, robot, message.arrived_at)
    except WireError as error:
        return Reading(None, str(error), f"Not understood: {error}.")
    return Reading(content, "", _summary(content))


def values_of(
    content: MobileOriginatedContent,
    robot: RobotId,
    session_at: datetime,
    arrived_at: datetime,
    find_plan: FindPlan,
    find_transfer: FindTransfer,
) -> Sequence[SatelliteReport]:
    """Return what a record tells, as radio would have told it.

    Args:
        content: The record.
        robot: Who says it.
        session_at: When it was said, by the satellite network's clock.
        arrived_at: When the station had it.
        find_plan: Finds plans by the digits that a record has room for.
        find_transfer: Finds a plan that waits on board.
    """
    told: list[SatelliteReport] = []
    if content.state is not None:
        told.append(content.state)
    if content.plan is not None:
        said_at = session_at if content.state is None else content.state.measured_at
        report = _plan_report(content.plan, robot, said_at, arrived_at, find_plan)
        told += (report, _plan_queue(content, report, find_transfer))
    if content.target is not None:
        told.append(content.target)
    if content.current is not None:
        told.append(content.current)
    channels = content.channels
    told.extend(one for one in (channels.page, channels.version) if one is not None)
    told.extend(channels.readings)
    told.extend(content.detections)
    told.extend(content.samples)
    return told


def _plan_report(
    plan: ShortPlanReport,
    robot: RobotId,
    said_at: datetime,
    arrived_at: datetime,
    find_plan: FindPlan,
) -> PlanReport:
    """Return a report with the full hash; a stranger's plan keeps the digits that were said."""
    sha256 = (find_plan(plan.digits) or PlanHash(plan.digits)) if plan.digits else None
    return PlanReport(
        robot=robot,
        sha256=sha256,
        state=plan.state,
        leg=plan.leg,
        legs=plan.legs,
        energy_used=plan.energy_used,
        reason=plan.reason.sentence,
        measured_at=said_at,
        received_at=arrived_at,
    )


def _plan_queue(
    content: MobileOriginatedContent, report: PlanReport, find_transfer: FindTransfer
) -> PlanQueue:
    """Return which plan waits; a record that names none says that none does.

    It has no room for the plan before. A stranger's plan keeps the digits of its transfer.
    """
    waiting = next((ack for ack in content.acks if is_waiting(ack)), None)
    name = None if waiting is None else waiting.transfer_id
    unknown = None if name is None else PlanHash(f"{name:08x}")
    return PlanQueue(
        robot=report.robot,
        sha256=report.sha256,
        next_sha256=None if name is None else find_transfer(name) or unknown,
        next_starts=waiting is not None and waiting.reason is Reason.NEXT_STARTS,
        last_sha256=None,
        last_done=False,
        measured_at=report.measured_at,
        received_at=report.received_at,
    )


def _transfer_word(ack: TransferAck) -> str:
    return ack.reason.sentence if is_waiting(ack) else ack.state.name.lower()


def _summary(content: MobileOriginatedContent) -> str:
    parts: list[str] = []
    if content.state is not None:
        north_m, east_m, _ = content.state.position_ned
        parts.append(
            f"{content.state.mode.name.lower()} at {north_m:.0f} m north, {east_m:.0f} m east"
        )
    if content.plan is not None and content.plan.state is not OnboardPlanState.NONE:
        plan = content.plan
        parts.append(f"plan {plan.digits[:8]} {plan.state.name.lower().replace('_', ' ')}")
    if content.target is not None:
        parts.append(f"target {content.target.phase.name.lower()}")
    parts.extend(
        f"transfer {ack.transfer_id:08x} {_transfer_word(ack)}, "
        f"{len(ack.received)} of {ack.count} parts"
        for ack in content.acks
    )
    parts.extend(f"order {one.number} {_OUTCOMES[one.outcome]}" for one in content.answers)
    if content.detections:
        parts.append(f"{len(content.detections)} heard tags")
    if content.channels.page is not None:
        page = content.channels.page
        parts.append(f"channels, page {page.page + 1} of {page.pages}")
    if content.channels.readings:
        parts.append(f"{len(content.channels.readings)} readings of itself")
    if content.samples:
        parts.append(f"{len(content.samples)} samples")
    text = "; ".join(parts) or "nothing new"
    return f"{text[0].upper()}{text[1:]}."
