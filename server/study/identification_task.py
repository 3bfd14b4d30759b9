"""Seeks the parameters of a vehicle in a recording."""

import time
from collections.abc import Callable

import numpy as np

from autonomy.campaign import ClusterError
from autonomy.identification.problem import problem_from
from autonomy.identification.progress import (
    CheckpointError,
    IdentificationCancelledError,
    IdentificationError,
    Progress,
)
from autonomy.identification.result import IdentificationResult
from autonomy.identification.run import identify
from server.base.study import Refusal
from server.study.task import (
    CHECKPOINT,
    IdentificationProblem,
    SearchNews,
)

CHECKPOINT_PERIOD_S = 2.0
"""A search that is cut off loses at most this much of its work, and one iteration."""


def run(
    task: IdentificationProblem,
    report: Callable[[SearchNews], None],
    is_cancelled: Callable[[], bool],
) -> IdentificationResult | Refusal:
    """Return what was found, or why there is nothing to find."""
    try:
        problem = problem_from(task.vehicle, task.recording, task.config)
        return identify(
            problem,
            task.config,
            np.random.default_rng(task.config.seed),
            report=_Reporter(report),
            is_cancelled=is_cancelled,
            resume=task.resume,
        )
    except IdentificationCancelledError:
        return Refusal("The identification was cancelled.")
    except CheckpointError as error:
        return Refusal(_sentence(error), CHECKPOINT)
    except IdentificationError as error:
        return Refusal(_sentence(error))
    except ClusterError as error:
        return Refusal(str(error))


def _sentence(error: IdentificationError) -> str:
    text = str(error).rstrip(".")
    return f"{text[0].upper()}{text[1:]}."


class _Reporter:
    """Passes progress on, with a checkpoint every now and then."""

    def __init__(self, report: Callable[[SearchNews], None]) -> None:
        self._report = report
        self._kept_s = -CHECKPOINT_PERIOD_S

    def __call__(self, progress: Progress) -> None:
        now_s = time.monotonic()
        is_due = now_s - self._kept_s >= CHECKPOINT_PERIOD_S
        if is_due:
            self._kept_s = now_s
        self._report(
            SearchNews(
                iteration=progress.iteration,
                iterations=progress.iterations,
                best_cost=progress.best_cost,
                spread=progress.spread,
                message=progress.message,
                checkpoint=progress.state if is_due else None,
            )
        )
