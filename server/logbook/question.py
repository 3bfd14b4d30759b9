"""What of the log book is asked for: by time, shift, robot, person, tag, kind and words."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from fastapi import Depends, Query
from pydantic import AwareDatetime
from sqlalchemy.orm import Session

from db.column import microseconds, moment
from db.deployment_span import Period
from db.query.log_book.entries import LogFilter, Place
from db.query.log_book.told import GROUPS, ToldFilter
from server.access.dependency import Viewer
from server.base.dependency import DeploymentDep, period_of
from server.base.problem import FieldError, conflict, unprocessable
from server.base.view import CURSOR_MAX
from server.logbook.span import last_two_shifts, my_shift

Group = Literal["entries", "orders", "dives", "alarms", "plans", "watch"]
Which = Literal["mine", "two"]
_ALL: tuple[Group, ...] = ("entries", "orders", "dives", "alarms", "plans", "watch")


@dataclass(frozen=True, slots=True)
class Question:
    """What of the log book is asked for."""

    person: str
    """Who asks."""
    entries: LogFilter
    told: ToldFilter
    shift: Which | None
    groups: tuple[Group, ...]

    def of(self, session: Session) -> "tuple[LogFilter | None, ToldFilter]":
        """Return what is to be read.

        Raises:
            Problem: 409 if a shift is asked for and there was none.
        """
        return self.within(self.period(session))

    def within(self, period: Period | None) -> "tuple[LogFilter | None, ToldFilter]":
        """Return what is to be read of a time."""
        entries, told = replace(self.entries, period=period), replace(self.told, period=period)
        return entries if "entries" in self.groups else None, told

    def period(self, session: Session) -> Period | None:
        """Return the time that is asked for, ``None`` for all time.

        Raises:
            Problem: 409 if a shift is asked for and there was none.
        """
        asked = self.entries.period
        if self.shift is None:
            return asked
        if self.shift == "mine":
            shift = my_shift(session, self.person)
            refusal = f"{self.person} has not begun a shift yet."
        else:
            shift = last_two_shifts(session)
            refusal = "Nobody has begun a shift yet."
        if shift is None:
            raise conflict(refusal)
        if asked is None:
            return shift
        return Period(*shift.cut(asked.first, asked.last))


async def _question(
    caller: Viewer,
    deployment: DeploymentDep,
    robot: Annotated[str | None, Query(description="Only about this robot.")] = None,
    author: Annotated[
        str | None, Query(max_length=100, description="Only what this person wrote or caused.")
    ] = None,
    tag: Annotated[
        str | None, Query(max_length=40, description="Only entries with this tag.")
    ] = None,
    text: Annotated[str, Query(max_length=200, description="A part of the words or tags.")] = "",
    group: Annotated[
        list[Group] | None, Query(description="What is shown; may be repeated. All by default.")
    ] = None,
    shift: Annotated[
        Which | None,
        Query(
            description="`mine`: of the caller's newest shift. `two`: since the shift before the "
            "present one began."
        ),
    ] = None,
    since: Annotated[
        AwareDatetime | None, Query(alias="from", description="First moment, RFC 3339.")
    ] = None,
    until: Annotated[
        AwareDatetime | None, Query(alias="to", description="Last moment, RFC 3339.")
    ] = None,
    before: Annotated[
        str | None,
        Query(pattern=r"^\d{1,16}\.[01]\.\d{1,18}$", description="`place` of the last line."),
    ] = None,
) -> Question:
    if since is not None and until is not None and until < since:
        raise unprocessable("1 field is wrong.", [FieldError(loc=["to"], msg="it is before from")])
    period = None
    if since is not None or until is not None:
        period = Period(since or moment(0), until)
    of_it = period_of(deployment, robot)
    if deployment is not None and of_it is not None:
        robot = deployment.robot
        period = of_it if period is None else Period(*of_it.cut(period.first, period.last))
    place = None if before is None else _place(before)
    asked: tuple[Group, ...] = _ALL if not group else tuple(dict.fromkeys(group))
    # An event has no tag: who asks for one wants entries.
    told = tuple(one for one in asked if one in GROUPS and tag is None)
    robots = caller.rights.robots
    entries = LogFilter(robot, None, author, tag, text, period, place, robots)
    events = ToldFilter(told, robot, period, author, text, place, robots)
    return Question(caller.name, entries, events, shift, asked)


QuestionDep = Annotated[Question, Depends(_question)]
"""What a request asks for of the log book."""


def place_text(place: Place) -> str:
    """Return a place as REST tells it."""
    return f"{microseconds(place.at)}.{place.rank}.{place.key}"


def _place(text: str) -> Place:
    at, rank, key = text.split(".")
    try:
        return Place(moment(int(at)), int(rank), min(int(key), CURSOR_MAX))
    except OverflowError as error:
        wrong = FieldError(loc=["before"], msg="no line stands there")
        raise unprocessable("1 field is wrong.", [wrong]) from error
