"""Makes decisions in workers, and keeps what each was made of and what came of it."""

import asyncio
import logging
import zlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any, TypeVar

from db.fault import StoreError, StoreUnavailableError
from db.query.mission.decisions import NewDecision, add_decision, missing_contents
from db.store import Store
from robot_link.clock import Clock
from server.base.decision.content import Packed, digest, packed, packed_json, quantized
from server.base.decision.kind import DecisionKind, part_of
from server.base.decision.software import software
from server.base.lifetime import Background
from server.base.worker import Withdrawn, WorkerPool, WorkerTaskError

log = logging.getLogger(__name__)

P = TypeVar("P")
R = TypeVar("R")
RETRY_S = 0.5


@dataclass(frozen=True, slots=True)
class Cause:
    """What a decision is about, and which settings were in force."""

    robot: str
    about: str = ""
    """Id of what comes of it, such as a plan's."""
    versions: Mapping[str, str | None] | None = None
    """Versions of the settings that it was made with, by their kind; ``None`` for the preset."""


class Decisions:
    """Where every decision that can be repeated is made. Belongs to one event loop."""

    def __init__(self, store: Store, clock: Clock, background: Background) -> None:
        self._store = store
        self._clock = clock
        self._background = background

    async def make(
        self,
        kind: DecisionKind[P, R],
        problem: P,
        cause: Cause,
        workers: WorkerPool,
        *,
        on_progress: Callable[[Any], None] | None = None,
    ) -> R:
        """Do what ``WorkerPool.run`` does, and keep the decision before it is acted on.

        While storage fails the decision is kept as soon as that works again. One that is cancelled
        is kept with how far it had come, if its worker could still say so.

        Raises:
            WorkerTaskError: The task raised.
            WorkerEndedError: The process died; no decision was made.
        """
        at = self._clock.now()
        told: list[Withdrawn | None] = []
        work = workers.run(
            kind.task,
            problem,
            on_progress=on_progress,
            on_withdrawn=told.append,
        )
        try:
            result: R = await work
        except asyncio.CancelledError:
            for left in told:
                # nothing was decided where the work had not begun, or left nothing
                end = _Ended("ended")
                if left is not None and left[0] is not None:
                    end = _Ended("cancelled", *left)
                await self._keep(kind, problem, cause, at, end)
            raise
        except WorkerTaskError as error:
            await self._keep(kind, problem, cause, at, _Ended("failed", message=str(error)))
            raise
        await self._keep(kind, problem, cause, at, _Ended("done", result))
        return result

    async def _keep(
        self,
        kind: DecisionKind[P, R],
        problem: P,
        cause: Cause,
        at: datetime,
        end: "_Ended",
    ) -> None:
        """Keep a decision now, or in the background as soon as storage works."""
        decision, contents = await asyncio.to_thread(_described, kind, problem, cause, at, end)
        try:
            await self._write(decision, contents)
        except StoreUnavailableError as error:
            log.warning("a decision about %s is kept later: %s", cause.robot, error)
            self._background.start(
                f"keep a decision of {cause.robot}", self._keep_later(decision, contents)
            )
        except StoreError as error:
            log.warning("a decision about %s is not kept: %s", cause.robot, error)

    async def _keep_later(self, decision: NewDecision, contents: Mapping[str, bytes]) -> None:
        while True:
            await asyncio.sleep(RETRY_S)
            try:
                await self._write(decision, contents)
            except StoreUnavailableError:
                continue
            return

    async def _write(self, decision: NewDecision, contents: Mapping[str, bytes]) -> None:
        missing = await self._store.query(lambda session: missing_contents(session, contents))
        deflated = await asyncio.to_thread(
            lambda: {name: zlib.compress(contents[name]) for name in missing}
        )
        await self._store.write(lambda session: add_decision(session, decision, deflated))


@dataclass(frozen=True, slots=True)
class _Ended:
    """How a decision's work ended."""

    state: str
    result: Any = None
    stopped_at: int | None = None
    message: str = ""


def outcome_of(kind: DecisionKind[P, R], result: R) -> Packed:
    """Return what counts of a result, quantized, as a content."""
    return packed_json(quantized(kind.outcome(result)))


def failure_of(message: str) -> Packed:
    """Return what counts of work that raised."""
    return packed_json({"failed": message})


def _described(
    kind: DecisionKind[P, R], problem: P, cause: Cause, at: datetime, end: _Ended
) -> tuple[NewDecision, Mapping[str, bytes]]:
    """Return a decision as it is kept, and the contents that it names."""
    made_of = packed(problem, kind.problem)
    outcome: Packed | None = None
    document: dict[str, Any] = {
        "seed": list(kind.seed(problem)),
        "versions": dict(cause.versions or {}),
        "software": software(),
        "stopped_at": end.stopped_at,
        "pace": None,
        "candidates": None,
    }
    if end.state == "failed":
        outcome = failure_of(end.message)
    elif end.state != "ended":
        pace = kind.pace(end.result)
        document["pace"] = None if pace is None else asdict(pace)
        document["candidates"] = kind.candidates(end.result)
        outcome = outcome_of(kind, end.result)
    decision = NewDecision(
        kind=kind.key,
        robot=cause.robot,
        about=cause.about,
        at=at,
        state=end.state,
        input_sha256=made_of.sha256,
        map_sha256=digest([part_of(made_of.tree, part) for part in kind.map_parts]),
        outcome_sha256=None if outcome is None else outcome.sha256,
        document=document,
    )
    return decision, {**made_of.contents, **({} if outcome is None else outcome.contents)}
