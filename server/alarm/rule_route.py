"""Rules of alarm: read, changed, tried on the past, taken out of service."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Header
from pydantic import Field

from db.query.station.alarm_rules import OutOfServiceRecord, RuleVersionRecord
from db.record import same
from robot_link.messages import STATE
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.alarm.route import Note
from server.alarm.rule import AlarmRule, ModeName, RuleKind, RuleLimit, Suppression
from server.alarm.rule_book import KnownRule, RuleBook, validated
from server.alarm.trial import Trials
from server.alarm.value import VALUES
from server.base.dependency import FoundationDep, service
from server.base.view import Body, JsonSchema, View
from server.base.work.job_view import JobBegun, JobView
from server.fleet.fleet import Fleet

router = APIRouter(prefix="/api/alarm-rules", tags=["alarms"], route_class=IdempotentRoute)
BookDep = Annotated[RuleBook, Depends(service(RuleBook))]
FleetDep = Annotated[Fleet, Depends(service(Fleet))]
TrialsDep = Annotated[Trials, Depends(service(Trials))]
IfMatch = Annotated[str | None, Header()]
DAYS_MAX = 31


@dataclass(frozen=True, slots=True)
class OutOfServiceView(View):
    """A rule that asks nobody for some time."""

    robot: str | None
    """``null`` for every robot."""
    reason: str
    begun_at: datetime
    begun_by: str


@dataclass(frozen=True, slots=True)
class AlarmRuleView(View):
    """One rule, and where it comes from."""

    rule: AlarmRule
    origin: Literal["delivered", "changed", "own"]
    """As delivered, delivered and changed here, or the team's own."""
    changed_at: datetime | None
    changed_by: str
    version: int
    """For ``If-Match``: another after each change, 0 as it was delivered."""
    out_of_service: list[OutOfServiceView]


@dataclass(frozen=True, slots=True)
class RuleVersionView(View):
    """What a rule was from a moment on."""

    rule: AlarmRule | None
    """``null``: as delivered, or gone where it was the team's own."""
    changed_at: datetime
    changed_by: str


@dataclass(frozen=True, slots=True)
class WatchedView(View):
    """Something that a rule can watch."""

    key: str
    title: str
    unit: str
    kind: Literal["gauge", "channel", "robot", "station"]
    """Of the state report, of the catalogue, or a value of the station about a robot or itself."""
    help: str
    is_kept: bool
    """Whether its past is kept, so that a rule over it can be tried."""


class RuleChanges(Body):
    """What is to be changed of a rule; what is left out stays. Bounds are those of the rule."""

    title: str | None = None
    """What lists call it."""
    kind: RuleKind | None = None
    """How it judges: limits, those of the catalogue, a rate, absence, an expression."""
    reads: str | None = None
    """Key of the channel or value that it watches."""
    expression: str | None = None
    """What is worked out, of a rule of the kind expression."""
    limits: tuple[RuleLimit, ...] | None = None
    """Values that deserve an alarm, one limit for each level at most."""
    hysteresis: float | None = None
    """How far a value must come back over a limit before the alarm clears, in its unit."""
    delay_s: float | None = None
    """How long a value must stay beyond a limit before the alarm is raised, s; to 86,400."""
    clear_after_s: float | None = None
    """How long it must be normal before the alarm clears, s; to 86,400."""
    window_s: float | None = None
    """Of a rate: the time over which the change is taken, s; 1 to 3,600."""
    robots: tuple[str, ...] | None = None
    """Ids of the robots that it is about; empty for all."""
    modes: tuple[ModeName, ...] | None = None
    """What a robot must be doing; empty for anything."""
    suppressed: tuple[Suppression, ...] | None = None
    """When it is no alarm by design."""
    text: str | None = None
    """The sentence of its alarm, with places in braces."""
    action: str | None = None
    """What a person may do about it."""


class TakenOut(Body):
    """For whom a rule is taken out of service, and why."""

    robot: str | None = None
    """``null`` for every robot."""
    reason: Note
    """Why; it is logged."""


class Trial(Body):
    """A rule, as it is or as it is typed, and the past that it is tried on."""

    rule: AlarmRule
    """The rule, as it is or as it is typed."""
    days: int = Field(default=7, ge=1, le=DAYS_MAX)
    """How many days back it is tried."""


@router.get("")
async def list_rules(caller: Viewer, book: BookDep) -> list[AlarmRuleView]:
    """Return every rule of alarm, the delivered ones first."""
    del caller
    return [_view(entry) for entry in book.entries]


@router.get("/schema")
async def rule_schema(caller: Viewer) -> JsonSchema:
    """Return the JSON Schema of a rule, which forms are made from."""
    del caller
    return JsonSchema(AlarmRule.model_json_schema())


@router.get("/watched")
async def list_watched(caller: Viewer, foundation: FoundationDep) -> list[WatchedView]:
    """Return everything that a rule can watch, by the names that expressions use."""
    del caller
    gauges = [
        WatchedView(key, gauge.title, STATE[key].unit, "gauge", gauge.help, is_kept=True)
        for key, gauge in STATE.gauges.items()
    ]
    channels = [
        WatchedView(one.key, one.title, one.unit, "channel", one.help, is_kept=not one.is_derived)
        for one in foundation.channels.catalogue.values()
    ]
    values = [
        WatchedView(
            one.key, one.title, one.unit, one.about, one.help, is_kept=one.history is not None
        )
        for one in VALUES.values()
    ]
    return gauges + channels + values


@router.post("", status_code=201)
async def add_rule(caller: Pilot, rule: AlarmRule, book: BookDep, fleet: FleetDep) -> AlarmRuleView:
    """Add a rule of the team's own.

    422 names each wrong field, and each name that does not exist.
    """
    return _view(await book.add(rule, _robots(fleet), caller.name))


@router.post("/try", status_code=202)
async def try_rule(
    caller: Pilot,
    trial: Trial,
    book: BookDep,
    fleet: FleetDep,
    trials: TrialsDep,
    begun: JobBegun,
) -> JobView:
    """Judge what robots said in the last days by a rule, beside the event loop.

    The job's result lists when it would have fired. 422 where it watches what is not kept.
    """
    book.check(trial.rule, _robots(fleet))
    return await begun(await trials.start(trial.rule, trial.days, caller.name))


@router.patch("/{rule}")
async def change_rule(
    caller: Pilot,
    rule: str,
    changes: RuleChanges,
    book: BookDep,
    fleet: FleetDep,
    if_match: IfMatch = None,
) -> AlarmRuleView:
    """Change fields of a rule; of a delivered one the station keeps its own version.

    412 says that it has another version than ``If-Match``, and who changed it.
    """
    given = changes.model_dump(mode="json", exclude_none=True)
    return _view(await book.change(rule, given, _robots(fleet), caller.name, if_match))


@router.delete("/{rule}")
async def remove_rule(
    caller: Pilot, rule: str, book: BookDep, if_match: IfMatch = None
) -> AlarmRuleView | None:
    """Give a changed rule back as it was delivered, or remove one of the team's own.

    412 says that it has another version than ``If-Match``, and who changed it.
    """
    entry = await book.remove(rule, caller.name, if_match)
    return None if entry is None else _view(entry)


@router.get("/{rule}/versions")
async def list_versions(caller: Viewer, rule: str, book: BookDep) -> list[RuleVersionView]:
    """Return what people made of a rule, the newest first."""
    del caller
    return [_version(one) for one in await book.versions(rule)]


@router.post("/{rule}/out-of-service")
async def take_out(caller: Pilot, rule: str, out: TakenOut, book: BookDep) -> AlarmRuleView:
    """Take a rule out of service, for one robot or for all, until somebody puts it back."""
    return _view(await book.take_out(rule, out.robot, out.reason.strip(), caller.name))


@router.delete("/{rule}/out-of-service")
async def put_back(
    caller: Pilot, rule: str, book: BookDep, robot: str | None = None
) -> AlarmRuleView:
    """Put a rule into service again."""
    return _view(await book.put_back(rule, robot, caller.name))


def _robots(fleet: Fleet) -> list[str]:
    return [status.record.id for status in fleet.statuses]


def _view(entry: KnownRule) -> AlarmRuleView:
    return same(AlarmRuleView, entry, out_of_service=[_out(one) for one in entry.out_of_service])


def _out(record: OutOfServiceRecord) -> OutOfServiceView:
    return same(OutOfServiceView, record)


def _version(record: RuleVersionRecord) -> RuleVersionView:
    rule = None if record.document is None else validated(record.document)
    return RuleVersionView(rule, record.changed_at, record.changed_by)
