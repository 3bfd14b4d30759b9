"""Checklists as an operator sees them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from db.query.mission.checklists import ChecklistRun, Tick
from db.record import same
from server.base.view import View, one_of
from server.checklist.check import CHECKS, Check
from server.checklist.checklists import ListStanding
from server.checklist.judging import ItemStanding
from server.checklist.template import ACT_WORDS, Act, ChecklistTemplate, template_of
from server.checklist.templates import KnownTemplate

RunState = Annotated[str, one_of("not begun", "open", "complete", "overruled", "expired")]
Demand = Annotated[str, one_of("off", "told", "required")]


@dataclass(frozen=True, slots=True)
class ChecklistTickView(View):
    """An item that somebody ticked, or unticked."""

    is_ticked: bool
    at: datetime
    by: str
    note: str


@dataclass(frozen=True, slots=True)
class ChecklistFindingView(View):
    """What an automatic item found."""

    is_passed: bool
    text: str
    """The value with its unit, or what is the matter."""
    at: datetime | None
    """When that was measured or told; ``null`` where it is the station's own word."""


@dataclass(frozen=True, slots=True)
class ChecklistItemView(View):
    """One item of a list."""

    key: str
    text: str
    help: str
    kind: Annotated[str, one_of("manual", "automatic")]
    is_blocking: bool
    is_done: bool
    """Whether nothing is left to do about it now."""
    is_meant: bool
    """``false`` of a check that means nothing while the robot flies a plan."""
    check: str
    """Key of its check; empty of a manual one."""
    limit_text: str
    """What the check is held against, with its unit; empty where it takes no number."""
    now: ChecklistFindingView | None
    """Of an automatic item."""
    yesterday: str
    """The value at this hour of yesterday; empty where none is known."""
    settled: ChecklistFindingView | None
    """What it found as the list was completed or overruled."""
    tick: ChecklistTickView | None
    """Who ticked it; ``null`` while it is not ticked."""
    history: list[ChecklistTickView]
    """Everything that was ticked and unticked, the earliest first."""


@dataclass(frozen=True, slots=True)
class ChecklistView(View):
    """A robot's list, by its run that counts now."""

    id: str | None
    """Of the run; ``null`` while none was begun."""
    template: str
    title: str
    act: Act
    act_text: str
    state: RunState
    text: str
    """How it stands, in one sentence."""
    begun_at: datetime | None
    begun_by: str
    expires_at: datetime | None
    settled_at: datetime | None
    settled_by: str
    reason: str
    items: list[ChecklistItemView]
    open_blocking: list[str]
    """Keys of the blocking items that are open now."""
    lets_start: bool
    """Whether a plan may be started, as far as this list goes."""


@dataclass(frozen=True, slots=True)
class RobotChecklistsView(View):
    """The lists of a robot, those that a start waits for first."""

    robot: str
    demand: Demand
    """What a start asks of them: nothing, that they are told of, or that they are complete."""
    is_start_open: bool
    """Whether nothing of them keeps a plan from starting now."""
    start_text: str
    """One sentence for whoever is about to send a plan; empty where nothing is to be said."""
    is_launch_open: bool
    """Whether nothing of them keeps a deployment from beginning now."""
    launch_text: str
    """One sentence for whoever is about to launch the robot; empty where nothing is to be said."""
    lists: list[ChecklistView]


@dataclass(frozen=True, slots=True)
class PastChecklistView(View):
    """A run as it was."""

    id: str
    robot: str
    deployment: str | None
    template: str
    title: str
    state: RunState
    begun_at: datetime
    begun_by: str
    ended_at: datetime | None
    settled_at: datetime | None
    settled_by: str
    reason: str
    items: list[ChecklistItemView]


@dataclass(frozen=True, slots=True)
class CheckLimitView(View):
    """The number that a check is held against."""

    title: str
    unit: str
    usual: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class ChecklistCheckView(View):
    """One thing that an automatic item can ask."""

    key: str
    title: str
    help: str
    limit: CheckLimitView | None
    holds_in_flight: bool


@dataclass(frozen=True, slots=True)
class ChecklistTemplateView(View):
    """A template, and where it comes from."""

    key: str
    template: ChecklistTemplate
    version: int
    """0 as it was delivered; who changes it names this."""
    origin: Annotated[str, one_of("delivered", "changed", "own")]
    saved_at: datetime | None
    saved_by: str


@dataclass(frozen=True, slots=True)
class ChecklistVersionView(View):
    """A template as it was saved once."""

    version: int
    template: ChecklistTemplate | None
    """``null`` from when it was as delivered again, or put away."""
    saved_at: datetime
    saved_by: str


def check_view(check: Check) -> ChecklistCheckView:
    """Return a check as REST says it."""
    limit = None if check.limit is None else same(CheckLimitView, check.limit)
    return same(ChecklistCheckView, check, limit=limit)


def template_view(known: KnownTemplate) -> ChecklistTemplateView:
    """Return a template as REST says it."""
    return same(ChecklistTemplateView, known)


def list_view(one: ListStanding, yesterday: dict[str, str]) -> ChecklistView:
    """Return a robot's list as REST says it.

    Args:
        one: How it stands.
        yesterday: Value at this hour of yesterday, by channel.
    """
    run, template = one.run, one.template
    found = {} if run is None else run.found.get("findings", {})
    return ChecklistView(
        id=None if run is None else run.id,
        template=one.known.key,
        title=template.title,
        act=template.act,
        act_text=ACT_WORDS[template.act],
        state=one.state,
        text=one.words,
        begun_at=None if run is None else run.begun_at,
        begun_by="" if run is None else run.begun_by,
        expires_at=None if run is None else run.expires_at,
        settled_at=None if run is None else run.settled_at,
        settled_by="" if run is None else run.settled_by,
        reason="" if run is None else run.reason,
        items=[_item_view(item, found, yesterday) for item in one.items],
        open_blocking=[item.item.key for item in one.open_now],
        lets_start=one.lets_start,
    )


def past_view(run: ChecklistRun, items: list[ItemStanding]) -> PastChecklistView:
    """Return a run as it was, with what its automatic items found as it was settled."""
    found = run.found.get("findings", {})
    views = [_item_view(item, found, {}) for item in items]
    return same(PastChecklistView, run, title=template_of(run.document).title, items=views)


def _item_view(
    one: ItemStanding, found: dict[str, Any], yesterday: dict[str, str]
) -> ChecklistItemView:
    item = one.item
    check = CHECKS.get(item.check)
    return ChecklistItemView(
        key=item.key,
        text=item.text,
        help=item.help or ("" if check is None else check.help),
        kind=item.kind,
        is_blocking=item.blocking,
        is_done=one.is_done,
        is_meant=one.is_meant,
        check=item.check,
        limit_text=_limit_text(check, item.limit),
        now=None if one.finding is None else same(ChecklistFindingView, one.finding),
        yesterday="" if check is None else yesterday.get(check.channel, ""),
        settled=_kept_view(found.get(item.key)),
        tick=None if one.tick is None else _tick_view(one.tick),
        history=[_tick_view(word) for word in one.words],
    )


def _kept_view(kept: dict[str, Any] | None) -> ChecklistFindingView | None:
    if kept is None:
        return None
    at = kept["at"]
    return ChecklistFindingView(
        kept["is_passed"], kept["text"], None if at is None else datetime.fromisoformat(at)
    )


def _tick_view(tick: Tick) -> ChecklistTickView:
    return same(ChecklistTickView, tick)


def _limit_text(check: Check | None, limit: float | None) -> str:
    if check is None or check.limit is None:
        return ""
    value = check.limit.usual if limit is None else limit
    return f"{check.limit.title.lower()} {value:g} {check.limit.unit}"


def start_text(lists: list[ListStanding], demand: str, deed: str = "start") -> str:
    """Return what is said to who sends a plan, or launches a robot; "" where nothing is."""
    if demand == "off":
        return ""
    waiting = [one for one in lists if not one.lets_start]
    if not waiting:
        return ""
    titles = " and ".join(one.template.title for one in waiting)
    verb = "are" if len(waiting) > 1 else "is"
    if demand == "required":
        return f"{titles} {verb} not complete; a {deed} is refused until then."
    return f"{titles} {verb} not complete."
