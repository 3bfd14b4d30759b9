"""The rules of alarm of one station: the delivered ones as its people changed them, and their own.

Versions are only ever added. The newest of a delivered rule is an override of it; one without a
document gives the rule back as it was delivered.
"""

import asyncio
import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from pydantic import ValidationError
from sqlalchemy.orm import Session

from db.query.station import alarm_rules as query
from db.query.station.alarm_rules import OutOfServiceRecord, RuleVersionRecord
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import STATE
from server.alarm.delivered import delivered
from server.alarm.rule import AlarmRule
from server.alarm.value import VALUES
from server.base.channels import Channels
from server.base.event_bus import EventBus
from server.base.problem import FieldError, Problem, conflict, not_found, unprocessable

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class AlarmRulesChanged:
    """A rule was added, changed or removed, or is out of service or back in it."""

    rule: str


@dataclass(frozen=True, slots=True)
class KnownRule:
    """A rule and where it comes from."""

    rule: AlarmRule
    origin: Literal["delivered", "changed", "own"]
    changed_at: datetime | None = None
    changed_by: str = ""
    version: int = 0
    """Grows with each change; 0 as it was delivered."""
    out_of_service: tuple[OutOfServiceRecord, ...] = ()


class RuleBook:
    """Belongs to one event loop."""

    def __init__(self, store: Store, clock: Clock, bus: EventBus, channels: Channels) -> None:
        self._store = store
        self._clock = clock
        self._bus = bus
        self._channels = channels
        self._own: dict[str, tuple[AlarmRule, RuleVersionRecord]] = {}
        self._out: list[OutOfServiceRecord] = []
        self._changing = asyncio.Lock()

    async def load(self) -> None:
        """Read what people changed; what this release cannot read is left out and logged."""

        def read(session: Session) -> tuple[list[RuleVersionRecord], list[OutOfServiceRecord]]:
            return query.newest_versions(session), query.list_out_of_service(session)

        versions, self._out = await self._store.query(read)
        for version in versions:
            try:
                self._take(version)
            except ValidationError as error:
                logger.warning("alarm rule %s is left out: %s", version.rule, error)

    @property
    def rules(self) -> dict[str, AlarmRule]:
        """Every rule by its key, the delivered ones first."""
        own = {key: rule for key, (rule, _) in self._own.items()}
        return {**self._delivered, **own}

    @property
    def entries(self) -> list[KnownRule]:
        """Every rule with where it comes from."""
        return [self._entry(rule) for rule in self.rules.values()]

    @property
    def out_of_service(self) -> frozenset[tuple[str, str | None]]:
        """Rule and robot, ``None`` for all, of what is out of service."""
        return frozenset((one.rule, one.robot) for one in self._out)

    def get(self, key: str) -> KnownRule:
        """Return a rule.

        Raises:
            Problem: 404 if there is none.
        """
        rule = self.rules.get(key)
        if rule is None:
            raise not_found(f"There is no alarm rule {key!r}.")
        return self._entry(rule)

    def check(self, rule: AlarmRule, robots: Iterable[str]) -> None:
        """Refuse a rule that reads what does not exist, or cannot be read as it wants.

        Raises:
            Problem: 422 with each name.
        """
        gauges, channels = STATE.gauges, self._channels.catalogue
        field = "expression" if rule.kind == "expression" else "reads"
        faults = [
            (field, f"there is no channel or value {name!r}")
            for name in sorted(rule.names)
            if name not in gauges and name not in channels and name not in VALUES
        ]
        if rule.kind == "catalogue" and rule.reads not in channels:
            faults.append(("reads", f"the catalogue has no limits of {rule.reads!r}"))
        if rule.kind in ("rate", "absence") and rule.reads in VALUES:
            words = f"a rule of the kind {rule.kind} watches a channel; {rule.reads!r} is none"
            faults.append(("reads", words))
        known = set(robots)
        faults += [
            ("robots", f"there is no robot {one!r}") for one in rule.robots if one not in known
        ]
        if faults:
            count = "1 field is" if len(faults) == 1 else f"{len(faults)} fields are"
            errors = [FieldError(loc=[name], msg=words) for name, words in faults]
            raise unprocessable(f"{count} wrong.", errors)

    async def add(self, rule: AlarmRule, robots: Iterable[str], by: str) -> KnownRule:
        """Add a rule of the team's own.

        Raises:
            Problem: 409 if there is one of its key; 422 as ``check`` does.
        """
        self.check(rule, robots)
        async with self._changing:
            if rule.key in self.rules:
                raise conflict(f"There is an alarm rule {rule.key!r} already.")
            await self._keep(rule.key, rule, by, "added")
            return self.get(rule.key)

    async def change(
        self,
        key: str,
        changes: Mapping[str, Any],
        robots: Iterable[str],
        by: str,
        if_match: str | None = None,
    ) -> KnownRule:
        """Change fields of a rule; of a delivered one the station keeps its own version.

        Raises:
            Problem: 404 without such a rule; 412 if ``if_match`` names another version; 422 with
                each wrong field.
        """
        async with self._changing:
            before = self._matched(key, if_match).rule
            rule = validated({**before.model_dump(mode="json"), **changes, "key": key})
            self.check(rule, robots)
            if rule != before:
                await self._keep(key, rule, by, "changed")
            return self.get(key)

    async def remove(self, key: str, by: str, if_match: str | None = None) -> KnownRule | None:
        """Give a changed rule back as it was delivered, or remove one of the team's own.

        Raises:
            Problem: 404 without such a rule; 409 if it is as it was delivered; 412 if
                ``if_match`` names another version.
        """
        async with self._changing:
            entry = self._matched(key, if_match)
            if entry.origin == "delivered":
                raise conflict(f"{entry.rule.title} is as it was delivered.")
            is_own = entry.origin == "own"
            await self._keep(key, None, by, "removed" if is_own else "reset", entry.rule.title)
            return None if is_own else self.get(key)

    async def versions(self, key: str) -> list[RuleVersionRecord]:
        """Return every version of a rule that people made, the newest first."""
        return await self._store.query(lambda session: query.list_versions(session, key))

    async def take_out(self, key: str, robot: str | None, reason: str, by: str) -> KnownRule:
        """Take a rule out of service, for a robot or for all.

        Raises:
            Problem: 404 without such a rule; 409 if it is out of service already.
        """
        at = self._clock.now()
        async with self._changing:
            title = self.get(key).rule.title
            if (key, robot) in self.out_of_service:
                raise conflict(f"{title} is out of service for {robot or 'all'} already.")

            def write(session: Session) -> OutOfServiceRecord:
                text = f"{by} took the alarm rule {title} out of service: {reason}"
                add_event(session, at, "alarm_rule.out_of_service", text, level="watch",
                          robot=robot, data={"rule": key})  # fmt: skip
                return query.begin_out_of_service(session, key, robot, reason, at, by)

            self._out.append(await self._store.write(write))
        self._bus.publish(AlarmRulesChanged(key))
        return self.get(key)

    async def put_back(self, key: str, robot: str | None, by: str) -> KnownRule:
        """Put a rule into service again.

        Raises:
            Problem: 404 without such a rule, or if it is in service.
        """
        at = self._clock.now()
        async with self._changing:
            title = self.get(key).rule.title
            found = next((one for one in self._out if (one.rule, one.robot) == (key, robot)), None)
            if found is None:
                raise not_found(f"{title} is in service for {robot or 'all'}.")

            def write(session: Session) -> None:
                text = f"{by} put the alarm rule {title} into service again."
                add_event(session, at, "alarm_rule.in_service", text, robot=robot,
                          data={"rule": key})  # fmt: skip
                query.end_out_of_service(session, found.key, at, by)

            await self._store.write(write)
            self._out.remove(found)
        self._bus.publish(AlarmRulesChanged(key))
        return self.get(key)

    def _matched(self, key: str, if_match: str | None) -> KnownRule:
        """Return a rule, if it is still of the version that somebody saw."""
        now = self.get(key)
        if if_match is not None and if_match not in {"*", etag(now)}:
            when = (
                "" if now.changed_at is None else f" by {now.changed_by} at {now.changed_at:%H:%MZ}"
            )
            raise Problem(
                412, f"{now.rule.title} was changed meanwhile{when}; nothing was overwritten."
            )
        return now

    @property
    def _delivered(self) -> dict[str, AlarmRule]:
        return delivered(self._channels.catalogue)

    def _entry(self, rule: AlarmRule) -> KnownRule:
        out = tuple(one for one in self._out if one.rule == rule.key)
        own = self._own.get(rule.key)
        if own is None:
            return KnownRule(rule, "delivered", out_of_service=out)
        is_own = rule.key not in self._delivered
        version = own[1]
        origin: Literal["own", "changed"] = "own" if is_own else "changed"
        return KnownRule(rule, origin, version.changed_at, version.changed_by, version.key, out)

    async def _keep(
        self, key: str, rule: AlarmRule | None, by: str, what: str, title: str = ""
    ) -> None:
        at = self._clock.now()
        document = None if rule is None else rule.model_dump(mode="json")
        name = title if rule is None else rule.title

        def write(session: Session) -> RuleVersionRecord:
            text = f"{by} {what} the alarm rule {name}."
            add_event(session, at, f"alarm_rule.{what}", text, data={"rule": key})
            return query.add_version(session, key, document, at, by)

        version = await self._store.write(write)
        self._take(version)
        self._bus.publish(AlarmRulesChanged(key))

    def _take(self, version: RuleVersionRecord) -> None:
        if version.document is None:
            self._own.pop(version.rule, None)
        else:
            rule = AlarmRule.model_validate(dict(version.document))
            self._own[version.rule] = (rule, version)


def etag(entry: KnownRule) -> str:
    """Return the name of a rule's version for ``ETag`` and ``If-Match``, quotes included."""
    return f'"{entry.version}"'


def validated(document: Mapping[str, Any]) -> AlarmRule:
    """Return a document as a rule.

    Raises:
        Problem: 422 with each wrong field.
    """
    try:
        return AlarmRule.model_validate(dict(document))
    except ValidationError as error:
        faults = [
            FieldError(
                loc=list(one["loc"]) or ["rule"], msg=one["msg"].removeprefix("Value error, ")
            )
            for one in error.errors()
        ]
        count = "1 field is" if len(faults) == 1 else f"{len(faults)} fields are"
        raise unprocessable(f"{count} wrong.", faults) from error
