"""How a run stands: each item with what was found of it and who ticked it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from db.query.mission.checklists import ChecklistRun, Tick
from server.checklist.check import CHECKS, Finding, Situation, judged
from server.checklist.template import GATING, ChecklistItem, ChecklistTemplate


@dataclass(frozen=True, slots=True)
class ItemStanding:
    """One item of a run now."""

    item: ChecklistItem
    finding: Finding | None
    """Of an automatic item."""
    words: tuple[Tick, ...]
    """Everything that was ticked and unticked of it, the earliest first."""
    is_meant: bool = True
    """Whether it means anything now: some checks mean nothing of a robot that flies."""

    @property
    def tick(self) -> Tick | None:
        """Who ticked it; None while it is not ticked."""
        return self.words[-1] if self.words and self.words[-1].is_ticked else None

    @property
    def is_done(self) -> bool:
        """Whether nothing is left to do about it."""
        if self.finding is not None:
            return self.finding.is_passed or not self.is_meant
        return self.tick is not None

    @property
    def words_if_open(self) -> str:
        """What is the matter, for a sentence."""
        return self.item.text if self.finding is None else f"{self.item.text} ({self.finding.text})"


def findings_of(template: ChecklistTemplate, situation: Situation) -> dict[str, Finding]:
    """Return what each automatic item finds, by its key."""
    return {
        item.key: judged(CHECKS[item.check], situation, item.limit)
        for item in template.items
        if item.kind == "automatic"
    }


def standing_of(
    template: ChecklistTemplate,
    findings: Mapping[str, Finding],
    ticks: Sequence[Tick],
    *,
    is_flying: bool = False,
) -> list[ItemStanding]:
    """Return every item of a list as it stands.

    Args:
        template: The list.
        findings: What its automatic items found.
        ticks: What was ticked in its run, the earliest first.
        is_flying: Whether the robot flies a plan already.
    """
    return [
        ItemStanding(
            item,
            findings.get(item.key),
            tuple(tick for tick in ticks if tick.item == item.key),
            is_meant=not is_flying or not item.check or CHECKS[item.check].holds_in_flight,
        )
        for item in template.items
    ]


def open_blocking(items: Sequence[ItemStanding]) -> list[ItemStanding]:
    """Return the items that keep a plan from starting."""
    return [one for one in items if one.item.blocking and not one.is_done]


def why_over(run: ChecklistRun, act: str, deployment: str | None, now: datetime) -> str:
    """Return why a run counts no more, "" if it does.

    Args:
        run: The run.
        act: Of its list.
        deployment: The one that its robot is in, if any.
        now: The robots' clock.
    """
    if run.expires_at is not None and now >= run.expires_at:
        return "its time was over"
    is_left = run.deployment is not None and run.deployment != deployment
    if act in GATING and is_left:
        return f"{run.deployment} has ended"
    return ""


def kept(items: Sequence[ItemStanding]) -> dict[str, Any]:
    """Return what is written down of a list as it is settled: the values, and what was open."""
    return {
        "findings": {
            one.item.key: {
                "is_passed": one.finding.is_passed,
                "text": one.finding.text,
                "at": None if one.finding.at is None else one.finding.at.isoformat(),
            }
            for one in items
            if one.finding is not None
        },
        "open": [one.item.key for one in items if not one.is_done],
    }


def listed(items: Sequence[ItemStanding]) -> str:
    """Return what is open as part of a sentence."""
    return "; ".join(one.words_if_open for one in items)
