"""What a robot may cost on one UTC day, and what it has cost."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from db.query.satellite.satellite_messages import credits_spent
from robot_link.satellite.config import Tariff


@dataclass(frozen=True, slots=True)
class Budget:
    """One robot's account of one day."""

    spent: int
    per_day: int

    @property
    def left(self) -> int:
        """Credits that may still be spent; a command to surface may go beyond them."""
        return max(0, self.per_day - self.spent)

    def allows(self, cost: int) -> bool:
        """Tell whether a message of this cost may be sent today."""
        return self.spent + cost <= self.per_day


def utc_day(now: datetime) -> tuple[datetime, datetime]:
    """Return the first moment of a day and of the next."""
    start = now.astimezone(UTC).replace(hour=0, minute=0, second=0, microsecond=0)
    return start, start + timedelta(days=1)


def budget_of(session: Session, robot: str, tariff: Tariff, now: datetime) -> Budget:
    """Return a robot's account of today.

    A message counts on the day on which its gateway took it, and on each day on which it waits for
    that. It counts once, however often it is handed over again because an answer was lost; one that
    the gateway refused does not count.
    """
    start, end = utc_day(now)
    return Budget(credits_spent(session, robot, start, end), tariff.credits_per_day)
