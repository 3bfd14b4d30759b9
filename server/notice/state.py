"""The state of a notice: nothing moves it but what was proved of it, by this table.

======  =========  =========  ================
state   evidence   becomes    event
======  =========  =========  ================
queued  taken      handed     notice.handed
queued  not taken  queued     notice.not_taken
queued  hopeless   given_up   notice.given_up
queued  seen       withdrawn  notice.withdrawn
======  =========  =========  ================

*Handed* says that a service took it, not that a person read it: that is what acknowledging is for.
"""

from datetime import datetime
from enum import StrEnum
from typing import Final

from sqlalchemy.orm import Session

from db.notice_tables import Notice
from db.query.station import notices as query
from db.query.station.events import add_event
from server.base.transition_table import transitions


class NoticeEvidence(StrEnum):
    """What can be proved of a notice."""

    TAKEN = "taken"
    """The service said that it has it."""
    NOT_TAKEN = "not taken"
    """The service refused, failed or was silent; it is asked again."""
    HOPELESS = "hopeless"
    """It was asked long enough, or there is nobody to send it to."""
    SEEN = "seen"
    """Somebody has seen all that it tells of before any service took it."""


_TABLE: Final = transitions(__doc__, NoticeEvidence)
_LEVELS: Final = {"notice.given_up": "warning", "notice.not_taken": "watch"}
_WORDS: Final = {
    "notice.handed": "A service took {notice} to {to}",
    "notice.not_taken": "No service took {notice} to {to}",
    "notice.given_up": "{notice} to {to} was given up",
    "notice.withdrawn": "{notice} to {to} was withdrawn",
}


def apply(
    session: Session,
    notice: str,
    evidence: NoticeEvidence,
    reply: str,
    at: datetime,
    unanswered: int | None = None,
) -> Notice | None:
    """Move a notice by its table and log it; None if that changes nothing.

    The first of several vain attempts is logged, and the end; the row counts them all.

    Args:
        session: The transaction.
        notice: Which.
        evidence: What was proved of it.
        reply: The service's words, or why there are none.
        at: The station's time.
        unanswered: After how many attempts in all the service may have it; ``None`` as noted.
    """
    row = query.notice_row(session, notice)
    step = _TABLE.get((row.state, evidence))
    if step is None:
        return None
    row.state = step.state
    if evidence is not NoticeEvidence.SEEN:
        row.attempts, row.tried_at = row.attempts + 1, at
    row.reply = reply
    row.unanswered = row.unanswered if unanswered is None else unanswered
    if step.state != "queued":
        row.ended_at = at
    if step.state != "queued" or row.attempts == 1:
        told = query.get_notice(session, notice)
        words = _WORDS[step.event].format(notice=notice, to=f"{told.person} ({told.contact_title})")
        add_event(
            session,
            at,
            step.event,
            f"{words}: {reply}",
            level=_LEVELS.get(step.event, "info"),
            data={"notice": notice, "topic": row.topic, "items": row.items},
        )
    return row
