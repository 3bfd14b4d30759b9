"""Asks for rows of deployments: small ones here, large ones in a worker that can be given up."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Final, TypeVar

from sqlalchemy.orm import Session
from starlette.requests import Request

from server.analysis import answer, kept
from server.analysis.answer import DivesFound, RowsFound
from server.analysis.question import Question, about_dives, question_of
from server.base.foundation import Foundation
from server.base.job import JobError
from server.base.problem import Problem
from server.base.study import worked_out
from server.base.worker import IsCancelled

HERE_MAX: Final = 100_000
"""Deployments of more samples are read in a worker."""
_LOOK_S: Final = 0.5
T = TypeVar("T")
Find = Callable[[Session, Question, IsCancelled], T]
OnShare = Callable[[float], None]
"""Told how far the reading is, 0 .. 1, by work that takes long."""


def unheard(_: float) -> None:
    """Tell nobody how far it is."""


class Analyses:
    """Reads deployments for figures. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation

    async def question(
        self,
        deployment: str,
        channels: list[str],
        dives: str,
        *,
        flag_max: int,
        limit: int | None = None,
    ) -> Question:
        """Return what is asked; see ``question_of`` for what is refused."""
        settings = self._foundation.settings
        url = settings.resolved_database_url
        question = await self._foundation.store.query(
            lambda session: question_of(
                session, deployment, url, channels, dives, flag_max=flag_max, limit=limit
            )
        )
        return replace(
            question,
            asked_at=self._foundation.clock.now(),
            kept_in=settings.data_dir / kept.FOLDER,
        )

    async def dives(
        self, request: Request, question: Question, on_share: OnShare = unheard
    ) -> DivesFound:
        """Return the dives of a deployment, and what can be asked of it.

        Raises:
            Problem: 503 if the work failed.
        """
        question = about_dives(question)
        return await self._found(request, question, answer.find_facts, answer.DIVES_TASK, on_share)

    async def rows(
        self, request: Request, question: Question, on_share: OnShare = unheard
    ) -> RowsFound:
        """Return thinned rows with their statistics.

        Raises:
            Problem: 503 if the work failed.
        """
        return await self._found(request, question, answer.find_rows, answer.ROWS_TASK, on_share)

    async def _found(
        self, request: Request, question: Question, find: Find[T], task: str, on_share: OnShare
    ) -> T:
        if question.size <= HERE_MAX:
            return await self._foundation.store.query(
                lambda session: find(session, question, lambda: False)
            )
        workers = self._foundation.study_workers
        work = worked_out(workers, task, question, lambda news: on_share(news[0]))
        try:
            return await _while_wanted(request, work)
        except JobError as error:
            raise Problem(503, f"The rows could not be read; try again. {error}") from error


async def _while_wanted(request: Request, work: Awaitable[T]) -> T:
    """Wait for work; call it off once whoever asked for it has gone.

    Raises:
        Problem: 503 if they have, which nobody reads.
    """
    task = asyncio.ensure_future(work)
    try:
        while not (await asyncio.wait((task,), timeout=_LOOK_S))[0]:
            if await request.is_disconnected():
                raise Problem(503, "Nobody waits for it any more.")
        return await task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
