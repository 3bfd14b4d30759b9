"""A checklist's template: what is looked at, by whom, and what of it keeps a plan from starting."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, ValidationError, model_validator

from server.base.problem import invalid
from server.base.text import Title
from server.base.view import Body
from server.checklist.check import CHECKS

ITEMS_MAX: Final = 60
KEY_PATTERN: Final = r"^[a-z][a-z0-9_]{0,39}$"
"""Of a template's key and of an item's."""
Act = Literal["start", "launch", "daily", "recovery"]
ACT_WORDS: Final[Mapping[str, str]] = {
    "start": "before a plan is started",
    "launch": "before a robot is launched, and before its first plan",
    "daily": "each day",
    "recovery": "when a robot is recovered",
}
GATING: Final = ("start", "launch")
"""Acts whose lists a start waits for."""
LAUNCHING: Final = ("launch",)
"""Acts whose lists the start of a deployment waits for."""
_VALID_MAX_H: Final = 24.0 * 31.0

Key = Annotated[str, Field(pattern=KEY_PATTERN)]


class ChecklistItem(Body):
    """One thing to look at."""

    key: Key
    """Names it within its list; ticks are kept under it."""
    text: Annotated[str, Field(min_length=1, max_length=160, pattern=r"\S")]
    """What must be so, in the present tense."""
    help: Annotated[str, Field(max_length=400)] = ""
    """How to see to it."""
    kind: Literal["manual", "automatic"] = "manual"
    """Ticked by a person, or judged by what the robot tells."""
    blocking: bool = True
    """Whether a start waits for it; else it is a warning."""
    check: str = ""
    """Of an automatic item: a key of `GET /api/checklist-checks`."""
    limit: float | None = None
    """Of an automatic item: the number that its check is held against, in the check's unit; null
    takes the usual one."""

    @model_validator(mode="after")
    def _fits_its_check(self) -> Self:
        if self.kind == "manual":
            if self.check or self.limit is not None:
                raise ValueError("a manual item has no check and no limit")
            return self
        check = CHECKS.get(self.check)
        if check is None:
            raise ValueError(f"there is no check {self.check!r}; there are {', '.join(CHECKS)}")
        if self.limit is None:
            return self
        if check.limit is None:
            raise ValueError(f"the check {check.key} takes no limit")
        if not check.limit.low <= self.limit <= check.limit.high:
            raise ValueError(
                f"the limit of {check.key} is {check.limit.low:g} to {check.limit.high:g}"
                f" {check.limit.unit}, not {self.limit:g}"
            )
        return self


class ChecklistTemplate(Body):
    """A checklist as teams write it."""

    title: Title
    """What lists call it."""
    act: Act
    """Before which act it is looked through; a start waits for those of a start and of a launch."""
    robots: Literal["all", "real", "simulated"] = "all"
    """Whether it is for all robots, for real or for simulated ones."""
    waters: Annotated[list[Literal["tank", "lake", "sea"]], Field(max_length=3)] = Field(
        default_factory=list[Literal["tank", "lake", "sea"]]
    )
    """Kinds of water in which it applies; none means all."""
    valid_h: float = Field(default=12.0, ge=0.0, le=_VALID_MAX_H)
    """Hours of the robots' clock after which a run of it counts no more; 0 means until the
    deployment ends."""
    items: Annotated[list[ChecklistItem], Field(min_length=1, max_length=ITEMS_MAX)]
    """What is looked at, in order."""

    @model_validator(mode="after")
    def _has_each_item_once(self) -> Self:
        keys = [item.key for item in self.items]
        twice = sorted({key for key in keys if keys.count(key) > 1})
        if twice:
            raise ValueError(f"two items have the key {twice[0]!r}")
        return self

    def applies_to(self, *, is_simulated: bool, water: str) -> bool:
        """Tell whether a robot in a kind of water goes through it."""
        wanted = "simulated" if is_simulated else "real"
        return self.robots in ("all", wanted) and (not self.waters or water in self.waters)


def template_of(document: Mapping[str, Any]) -> ChecklistTemplate:
    """Return the template of a document.

    Raises:
        Problem: 422 that names each field that is wrong.
    """
    try:
        return ChecklistTemplate.model_validate(document)
    except ValidationError as error:
        raise invalid(error, ChecklistTemplate) from error
