"""The contact window and the suggestion as REST tells them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Literal

from server.base.view import View, one_of

Surfacing = Literal["now", "next"]
ContactState = Annotated[str, one_of("open", "closed", "unknown")]
SuggestionState = Annotated[
    str, one_of("none", "searching", "replace", "keep", "failed", "cancelled")
]
Timeliness = Annotated[str, one_of("in_time", "late", "sent", "gone")]


@dataclass(frozen=True, slots=True)
class MomentView(View):
    """A moment that is expected, and who says so."""

    at: datetime
    source: str
    """What it is reckoned from: the robot's word, its plan on board, a parameter, as built."""


@dataclass(frozen=True, slots=True)
class ContactWindowView(View):
    """How long a robot is expected to be in contact, or when it will be again."""

    robot: str
    state: ContactState
    """``open``: it lies at the surface; ``closed``: it is in a dive; ``unknown``: it never said."""
    text: str
    """In one sentence or two."""
    link: str
    """Carrier that hears it now; empty where none does."""
    heard_at: datetime | None
    """Of its last word on any link."""
    since: datetime | None
    """When it came up, by its own word; ``null`` where it did not say."""
    closes: MomentView | None
    """When it is expected to dive; ``null`` where no dive is planned, or nobody can say."""
    earliest: MomentView | None
    """It does not dive before."""
    latest: MomentView | None
    """While samples are not acknowledged it waits no longer than to here."""
    opens: MomentView | None
    """When it is expected up again; of an ``open`` one, after the coming dive."""
    hears_under_water: bool
    """Whether radio reaches it in a dive as well; a new plan begins at a surfacing all the same."""


@dataclass(frozen=True, slots=True)
class JudgedView(View):
    """What a plan, or the rest of one, is expected to bring; figures of models alone."""

    removed: float
    """Part of the map's variance, the mean over the water, that it takes away, 0..1."""
    map_std: float
    """Mean standard deviation of the map after it, in the scale of the field's model."""
    worst_map_std: float
    """The greatest."""
    objective: float
    """By the plan's own objective."""
    worst_position_std_m: float
    """Greatest uncertainty of the robot's position on the way."""
    energy: float
    """Energy units, surfacings included."""
    duration_s: float
    dives: int
    flights: int
    """Flights ahead that the figures of the map are the mean of; 0 for those of the plan as it is
    written."""


@dataclass(frozen=True, slots=True)
class ComparedPlanView(View):
    """One of the plans that were held against each other."""

    plan: str
    brings: JudgedView
    """If it alone were flown from now on, judged as it is written."""


@dataclass(frozen=True, slots=True)
class AutomationView(View):
    """What the station may do of itself for a robot, and how much of that is used."""

    suggestions: Literal["asked", "offered", "sent"]
    """When suggestions are made, and whether they are sent by themselves."""
    least_gain: float
    most_sends_per_hour: int
    sent_last_hour: int
    """By the same count as every plan that is sent by itself."""
    free_at: datetime | None
    """When the next may be sent; ``null`` while one may be."""
    text: str


@dataclass(frozen=True, slots=True)
class PlanSuggestionView(View):
    """A new plan for a robot that flies one, held against what is left of that."""

    robot: str
    state: SuggestionState
    """``replace`` offers a draft, ``keep`` says that the present plan is as good."""
    text: str
    """The gain in words and figures, or why there is none."""
    basis: str
    """What the figures are made of, with ages as they were then."""
    can_ask: bool
    why_not: str
    """Why no suggestion can be asked for now; empty where one can."""
    job: str | None
    """Of the search under way; its progress and its cancel are those of any job."""
    plan: str | None
    """The draft."""
    plan_state: str | None
    instead_of: str | None
    """The plan that it is held against."""
    surfacing: Surfacing | None
    """Whether it begins where the robot lies now, or where it is to come up next."""
    begins_ne_m: tuple[float, float] | None
    gain: float | None
    """How much more it brings than what is left of the present plan; 0.12 for 12 % more."""
    measure: str
    """By which measure, in words."""
    keep: JudgedView | None
    new: JudgedView | None
    judged_at: datetime | None
    fix_at: datetime | None
    """Of the position that it begins at; ``null`` where that was the plan's and no fix's."""
    fix_std_m: float | None
    samples: int | None
    """In the map that both are judged on."""
    newest_sample_at: datetime | None
    until: datetime | None
    """When the robot must have it, as expected; after that it is late."""
    timeliness: Timeliness | None
    """``in_time`` still; ``late``: the present plan goes on; ``sent``; ``gone``: no draft now."""
    timeliness_text: str
    automation: AutomationView
