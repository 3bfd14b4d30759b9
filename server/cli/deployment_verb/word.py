"""What the actions of ``grace deployment`` share: who acts, moments as they are typed, refusals."""

from datetime import UTC, datetime

from server.base.problem import Problem

BY = "command line"


def utc_moment(text: str) -> datetime:
    """Return a moment typed in ISO 8601; without a zone it is UTC."""
    at = datetime.fromisoformat(text)
    return at.replace(tzinfo=UTC) if at.tzinfo is None else at


def refusal(problem: Problem) -> str:
    """Return why something was refused, with each field that does not fit."""
    fields = [f"{'.'.join(map(str, one.loc))}: {one.msg}" for one in problem.errors or ()]
    return "; ".join([problem.detail, *fields])
