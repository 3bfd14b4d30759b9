"""What would go by some rules, before they are set."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.identity import public_id
from db.query.storage.hold import Hold, holds, is_held
from db.query.storage.prunable import PRUNABLE, Prunable, day_begins, day_of, days, parts
from db.query.storage.rows import HourOf, count_rows, old_rows
from db.query.storage.size import row_bytes
from db.query.storage.taking import thinned_days
from db.sample_tables import COARSE_S
from db.storage_tables import NOBODY
from db.store import Store
from db.tables import Deployment, Robot
from robot_link.storage_config import StorageConfig
from server.storage.pruning import Rule, due_day, gone_of_day, held_robots, period_of, rule_of


@dataclass(frozen=True, slots=True)
class Going:
    """Rows of one kind that would go, of one robot and deployment."""

    kind: str
    robot: str
    """"" of packets of nobody known, and where rows of all robots lie together."""
    deployment: str
    """"" of what is outside of any."""
    rows: int
    bytes: int


@dataclass(frozen=True, slots=True)
class Staying:
    """A deployment that is old enough and stays all the same."""

    robot: str
    deployment: str
    because: str


@dataclass(frozen=True, slots=True)
class Preview:
    """What would go, and what would stay."""

    going: list[Going]
    staying: list[Staying]

    @property
    def rows(self) -> int:
        """All that would go."""
        return sum(one.rows for one in self.going)

    @property
    def bytes(self) -> int:
        """Of all that would go; judged."""
        return sum(one.bytes for one in self.going)


class Previewer:
    """Looks at what a pass would take, and takes nothing. Runs in a thread of its own.

    Args:
        store: The station's memory.
        now: By the station's clock.
        go_on: Called between two steps; raises where it is to end.
        report: Told how far it is, 0 .. 1, and at what.
    """

    def __init__(
        self,
        store: Store,
        now: datetime,
        go_on: Callable[[], None] = lambda: None,
        report: Callable[[float, str], None] = lambda _share, _text: None,
    ) -> None:
        self._store = store
        self._now = now
        self._go_on = go_on
        self._report = report

    def run(self, config: StorageConfig) -> Preview:
        """Return what a pass by these rules would take now.

        Raises:
            StoreError: If the database does not answer.
        """
        with self._store.read() as session:
            held = holds(session, self._now)
            robots = {row.key: row.id for row in session.execute(select(Robot.key, Robot.id))}
            spans = _spans(session)
        going: Counter[tuple[str, int, str]] = Counter()
        staying: dict[tuple[int, str], str] = {}
        due = [kind for key, kind in PRUNABLE.items() if rule_of(config, key).then != "keep"]
        for place, kind in enumerate(due):
            self._report(place / len(due), kind.title)
            rule = rule_of(config, kind.key)
            with self._store.read() as session:
                owners = parts(session, kind)
            for robot_key in owners:
                for day in self._days(kind, rule, robot_key):
                    self._go_on()
                    for hold in held:
                        if hold.about and hold.has(day) and hold.robot_key in (robot_key, NOBODY):
                            staying[hold.robot_key, hold.about] = hold.because
                    rows = self._rows(kind, rule, robot_key, day, held)
                    if rows:
                        going[kind.key, robot_key, _deployment(spans, robot_key, day)] += rows
        with self._store.read() as session:
            width = {kind.key: row_bytes(session, kind.table.name) for kind in due}
        return Preview(
            [
                Going(kind, robots.get(key, ""), about, rows, round(rows * width[kind]))
                for (kind, key, about), rows in going.items()
            ],
            [Staying(robots[key], about, because) for (key, about), because in staying.items()],
        )

    def _days(self, kind: Prunable, rule: Rule, robot_key: int) -> list[int]:
        with self._store.read() as session:
            found = list(days(session, kind, robot_key, due_day(self._now, rule)))
            done: set[int] = set()
            if rule.then == "thin":
                done = thinned_days(session, kind.key, robot_key, period_of(rule))
        return [day for day in found if day not in done]

    def _rows(self, kind: Prunable, rule: Rule, robot_key: int, day: int, held: list[Hold]) -> int:
        """Return how many rows of a day would go."""
        if kind.is_by_robot and is_held(held, robot_key, day):
            return 0
        before = day_begins(due_day(self._now, rule))
        with self._store.read() as session:
            out = [] if kind.is_by_robot else held_robots(session, held, day)
            where = old_rows(kind, before, out)
            if rule.then != "thin":
                if kind.rollup is not None:
                    return _summed(session, kind, robot_key, day)
                return count_rows(session, kind, HourOf(robot_key, day), where)
        gone = gone_of_day(self._store, kind, robot_key, day, where, period_of(rule))
        return sum(1 for _ in gone)


def _summed(session: Session, kind: Prunable, robot_key: int, day: int) -> int:
    """Return how many values a day has, by the sums that are kept of it."""
    of = kind.rollup
    if of is None:
        return 0
    statement = select(func.sum(of.size)).where(
        of.robot_key == robot_key, of.length_s == COARSE_S, of.stretch == day
    )
    return int(session.scalar(statement) or 0)


_Span = tuple[int, int, int | None, str]
"""Robot, first day, last day and id of a deployment."""


def _spans(session: Session) -> list[_Span]:
    found = session.execute(
        select(
            Deployment.robot_key, Deployment.started_at, Deployment.ended_at, Deployment.key
        ).where(Deployment.void_reason == "", Deployment.started_at.is_not(None))
    )
    return [
        (
            robot_key,
            day_of(started_at),
            None if ended_at is None else day_of(ended_at),
            public_id("deployment", key),
        )
        for robot_key, started_at, ended_at, key in found
        if started_at is not None
    ]


def _deployment(spans: list[_Span], robot_key: int, day: int) -> str:
    for owner, first, last, about in spans:
        if owner == robot_key and first <= day and (last is None or day <= last):
            return about
    return ""
