"""Makes decisions once more of what they were made of, and says of each whether it is the same."""

import asyncio
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, cast

from autonomy.planner.plan import Pace
from db.query.mission.decisions import DecisionRange, DecisionRecord, content_of, list_decisions
from db.store import Store
from server.base.decision.content import ContentError, Packed, json_of, unpacked
from server.base.decision.decisions import failure_of, outcome_of
from server.base.decision.kind import DecisionKind
from server.base.decision.rerun_task import RERUN, Rerun
from server.base.decision.software import PROCESSOR, differing, software
from server.base.worker import WorkerEndedError, WorkerPool, WorkerTaskError

Word = Literal["same", "different", "cannot"]
OnProgress = Callable[[float, str], None]
_UNTOLD = "the station or its worker was ended before it could say how far the work had come"
_SHOWN_MAX = 60
"""Characters of a value that a sentence shows."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What came of making a decision once more."""

    decision: DecisionRecord
    word: Word
    because: str
    """Why it is not the same, a sentence without its end; "" where it is."""


def counted(verdicts: Sequence[Verdict]) -> str:
    """Return how many were the same, different, and impossible, in words."""
    of = Counter(verdict.word for verdict in verdicts)
    return (
        f"{len(verdicts)} decisions: {of['same']} same, {of['different']} different, "
        f"{of['cannot']} that cannot be made again"
    )


class DecisionReplay:
    """Replays decisions one after the other. Belongs to one event loop."""

    def __init__(
        self, store: Store, workers: WorkerPool, kinds: Sequence[DecisionKind[Any, Any]]
    ) -> None:
        self._store = store
        self._workers = workers
        self._kinds = {kind.key: kind for kind in kinds}

    async def run(self, wanted: DecisionRange, on_progress: OnProgress) -> list[Verdict]:
        """Make decisions once more, in the order in which they were made.

        Cancelling the awaiting task ends the work that is under way.

        Args:
            wanted: Which.
            on_progress: Told the share that is done, and what is under way.

        Raises:
            StoreUnavailableError: If storage fails.
        """
        decisions = await self._store.query(lambda session: list_decisions(session, wanted))
        verdicts: list[Verdict] = []
        for number, decision in enumerate(decisions):
            text = f"{number + 1} of {len(decisions)}: {self.title(decision)} of {decision.robot}"
            on_progress(number / len(decisions), text)
            verdicts.append(await self.verdict(decision))
        return verdicts

    def title(self, decision: DecisionRecord) -> str:
        """Return what was decided, in words."""
        kind = self._kinds.get(decision.kind)
        return decision.kind if kind is None else kind.title

    async def verdict(self, decision: DecisionRecord) -> Verdict:
        """Make one decision once more.

        Raises:
            StoreUnavailableError: If storage fails.
        """
        kind = self._kinds.get(decision.kind)
        obstacle = await asyncio.to_thread(_obstacle, decision, kind)
        if kind is None or obstacle:
            return Verdict(decision, "cannot", obstacle)
        try:
            problem = await self._problem(decision, kind)
            now = await self._made(decision, kind, problem)
            if now.sha256 == decision.outcome_sha256:
                return Verdict(decision, "same", "")
            return Verdict(decision, "different", await self._difference(decision, now))
        except (ContentError, WorkerEndedError) as error:
            return Verdict(decision, "cannot", str(error).rstrip("."))

    async def _problem(self, decision: DecisionRecord, kind: DecisionKind[Any, Any]) -> Any:  # noqa: ANN401 - the kind's own problem
        problem = await self._store.query(
            lambda session: unpacked(
                kind.problem, decision.input_sha256, partial(content_of, session)
            )
        )
        pace = decision.document["pace"]
        if pace is None:
            return problem
        turns = tuple((int(first), float(part)) for first, part in pace["turns"])
        return kind.paced(problem, Pace(int(pace["iterations"]), turns))

    async def _made(
        self,
        decision: DecisionRecord,
        kind: DecisionKind[Any, Any],
        problem: Any,  # noqa: ANN401 - the kind's own problem
    ) -> Packed:
        again = Rerun(kind.task, problem, decision.document["stopped_at"])
        try:
            result = await self._workers.run(RERUN, again)
        except WorkerTaskError as error:
            return failure_of(str(error))
        return await asyncio.to_thread(outcome_of, kind, result)

    async def _difference(self, decision: DecisionRecord, now: Packed) -> str:
        then = await self._store.query(
            lambda session: json_of(str(decision.outcome_sha256), partial(content_of, session))
        )
        text = difference(then, now.tree)
        before, here = decision.document["software"].get(PROCESSOR), software()[PROCESSOR]
        return text if before == here else f"{text}; it was made on another processor, {before}"


def difference(then: object, now: object, place: str = "") -> str:
    """Return in words the first thing in which two outcomes differ; "" if nothing does."""
    if isinstance(then, dict) and isinstance(now, dict):
        before, after = cast("Mapping[str, Any]", then), cast("Mapping[str, Any]", now)
        keys = sorted(before.keys() | after.keys())
        pairs = [(f"{place} {key}".strip(), before.get(key), after.get(key)) for key in keys]
    elif isinstance(then, list) and isinstance(now, list):
        old, new = cast("list[Any]", then), cast("list[Any]", now)
        if len(old) != len(new):
            return f"{place or 'the outcome'} had {len(old)} parts then and has {len(new)} now"
        pairs = [
            (f"{place} {number}".strip(), *both)
            for number, both in enumerate(zip(old, new, strict=True), start=1)
        ]
    else:
        if then == now:
            return ""
        return f"{place or 'the outcome'} was {_shown(then)} then and is {_shown(now)} now"
    return next((found for found in (difference(b, a, at) for at, b, a in pairs) if found), "")


def _shown(value: object) -> str:
    text = str(value)
    return text if len(text) <= _SHOWN_MAX else f"{text[:_SHOWN_MAX]}..."


def _obstacle(decision: DecisionRecord, kind: DecisionKind[Any, Any] | None) -> str:
    """Return why a decision cannot be made once more, "" if it can."""
    if kind is None:
        return f"this station makes no decisions of the kind {decision.kind}"
    if decision.outcome_sha256 is None:
        return _UNTOLD
    others = differing(decision.document["software"], software())
    return f"it was made by other software: {'; '.join(others)}" if others else ""
