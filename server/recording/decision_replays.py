"""Replays of a robot's decisions as jobs, and what the newest of them found."""

from collections import Counter
from collections.abc import Mapping
from typing import Any, cast

from typing_extensions import TypedDict

from db.query.mission.decisions import DecisionRange
from db.query.station.jobs import newest_job
from server.base.decision.replay import DecisionReplay, Verdict, counted
from server.base.foundation import Foundation
from server.base.job import JobPerKey, JobProgress
from server.recording.decision_kind import KINDS

_KIND = "replay of decisions"


class DecisionReplayResult(TypedDict):
    """What a replay of decisions found."""

    message: str
    same: int
    different: int
    cannot: int
    verdicts: list[list[str]]
    """Of each its id, the word, and why."""


class DecisionReplays:
    """One replay a robot at a time, beside all other work. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._store = foundation.store
        self.replay = DecisionReplay(foundation.store, foundation.study_workers, KINDS)
        self._jobs = JobPerKey[str](foundation.jobs, _KIND)

    async def start(self, robot: str, wanted: DecisionRange, *, by: str) -> str:
        """Begin a replay; return the id of its job, of the one under way if there is one.

        Raises:
            StoreError: Nothing was begun.
        """

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            return _result(await self.replay.run(wanted, progress.report))

        return await self._jobs.start(robot, work, by=by, robot=robot)

    def job(self, robot: str) -> str | None:
        """Return the id of the replay under way."""
        return self._jobs.get(robot)

    async def found(self, robot: str) -> Mapping[str, tuple[str, str]]:
        """Return word and reason of the decisions that the newest whole replay made once more."""
        job = await self._store.query(lambda session: newest_job(session, _KIND, robot))
        result = {} if job is None or job.result is None else job.result
        told = cast("list[list[str]]", result.get("verdicts", []))
        return {decision: (word, because) for decision, word, because in told}


def _result(verdicts: list[Verdict]) -> DecisionReplayResult:
    of = Counter(verdict.word for verdict in verdicts)
    return {
        "message": f"{counted(verdicts)}.",
        "same": of["same"],
        "different": of["different"],
        "cannot": of["cannot"],
        "verdicts": [[one.decision.id, one.word, one.because] for one in verdicts],
    }
