"""A rule of alarm as a document: what it watches, beyond which limits, and what it says then."""

import re
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from autonomy.channel import ALARM_LEVELS, AlarmLevel
from autonomy.described import Described
from server.alarm.expression import LENGTH_MAX, ExpressionError, compile_expression
from server.base.text import Title, checked

RuleKind = Literal["limit", "catalogue", "rate", "absence", "expression"]
Suppression = Literal["workshop", "under_water", "planned_dive"]
ModeName = Literal[
    "idle", "diving", "gliding", "spiralling", "swimming", "turning", "surfaced", "aborting",
    "holding", "tracking", "searching", "driven",
]  # fmt: skip
"""Of ``robot_link.messages.RobotMode``."""
KEY_PATTERN: Final = r"^[a-z][a-z0-9_ -]{0,59}$"
PLACES: Final = ("robot", "title", "value", "limit", "side", "detail")
"""What a sentence may leave to be filled in, each in braces."""
TEXT_MAX: Final = 300
DAY_S: Final = 86_400.0
_SECONDS: Final[JsonDict] = {"unit": "s"}
_PLACE = re.compile(r"\{([^{}]*)\}")


def _with_known_places(text: str) -> str:
    wrong = next((one for one in _PLACE.findall(text) if one not in PLACES), None)
    if wrong is not None:
        known = ", ".join(f"{{{one}}}" for one in PLACES)
        raise ValueError(f"{{{wrong}}} stands for nothing; there are {known}")
    return checked(text)


def filled(text: str, values: dict[str, str]) -> str:
    """Return a sentence with its places filled in."""
    return _PLACE.sub(lambda found: values[found[1]], text)


class _Document(Described, BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RuleLimit(_Document):
    """Values that deserve an alarm of a level."""

    level: AlarmLevel
    """How much it matters: info, watch, warning, severe, critical."""
    low: float | None = Field(default=None, allow_inf_nan=False)
    """Below it."""
    high: float | None = Field(default=None, allow_inf_nan=False)
    """Above it; of a time: from then on."""

    @model_validator(mode="after")
    def _has_an_end(self) -> Self:
        if self.low is None and self.high is None:
            raise ValueError(f"the {self.level} limit needs a low or a high end")
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise ValueError(f"the {self.level} limit's low end must be below its high one")
        return self


class AlarmRule(_Document):
    """One cause of alarm."""

    key: str = Field(pattern=KEY_PATTERN)
    """Names the cause: at most one alarm of it stands for each robot."""
    title: Title
    """What lists call it."""
    kind: RuleKind = "limit"
    """Limits of a value; the limits that the catalogue has of a channel; its change in a minute;
    how long, s, it was not told; or an expression."""
    reads: str = Field(default="", max_length=60)
    """Key of the channel or value that it watches; empty for an expression."""
    expression: str = Field(default="", max_length=LENGTH_MAX)
    """Such as ``internal_pressure > 1050 and depth_m > 1``; a condition is 1 where it holds."""
    limits: tuple[RuleLimit, ...] = Field(default=(), max_length=len(ALARM_LEVELS))
    """At most one of each level; empty where those of the catalogue are meant."""
    hysteresis: float = Field(default=0.0, ge=0.0, le=1e9, allow_inf_nan=False)
    """So far must a value come back over a limit before the alarm clears; in its unit."""
    delay_s: float = Field(
        title="Delay",
        default=0.0,
        ge=0.0,
        le=DAY_S,
        allow_inf_nan=False,
        json_schema_extra=_SECONDS,
    )
    """So long must a value stay beyond a limit before the alarm is raised."""
    clear_after_s: float = Field(
        title="Clear after",
        default=0.0,
        ge=0.0,
        le=DAY_S,
        allow_inf_nan=False,
        json_schema_extra=_SECONDS,
    )
    """So long must it be normal again before the alarm clears."""
    window_s: float = Field(
        title="Window of a rate",
        default=60.0,
        ge=1.0,
        le=3600.0,
        allow_inf_nan=False,
        json_schema_extra=_SECONDS,
    )
    """Of a rate: the time over which the change is taken."""
    robots: tuple[str, ...] = Field(default=(), max_length=100)
    """Which robots it is about; empty for all."""
    modes: tuple[ModeName, ...] = Field(default=(), max_length=12)
    """What a robot must be doing; empty for anything."""
    suppressed: tuple[Suppression, ...] = Field(default=(), max_length=3)
    """When it is no alarm by design: in the workshop, under water, while a dive is planned."""
    text: Annotated[
        str,
        Field(title="Sentence", min_length=1, max_length=TEXT_MAX),
        AfterValidator(_with_known_places),
    ]
    """The sentence, with {robot}, {title}, {value}, {limit}, {side} and {detail} filled in."""
    action: Annotated[str, Field(max_length=TEXT_MAX), AfterValidator(checked)] = ""
    """What a person may do about it."""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        levels = [limit.level for limit in self.limits]
        if len(set(levels)) < len(levels):
            raise ValueError("limits: each level may have one limit")
        if self.kind == "expression":
            try:
                names = compile_expression(self.expression).names
            except ExpressionError as error:
                raise ValueError(f"expression: {error}") from error
            if not names:
                raise ValueError("expression: it reads nothing")
        elif not self.reads:
            raise ValueError(f"reads: a rule of the kind {self.kind} must watch something")
        if (self.kind == "catalogue") == bool(self.limits):
            words = "has those of the catalogue" if self.limits else "needs one limit at least"
            raise ValueError(f"limits: a rule of the kind {self.kind} {words}")
        return self

    @property
    def names(self) -> frozenset[str]:
        """What it reads."""
        if self.kind == "expression":
            return compile_expression(self.expression).names
        return frozenset((self.reads,))
