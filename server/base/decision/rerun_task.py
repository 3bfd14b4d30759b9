"""Does once more what a decision was made by, and stops it where it was stopped then."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

RERUN: Final = "server.base.decision.rerun_task:run"
"""Takes a ``Rerun``, reports and leaves what its task does."""


@dataclass(frozen=True, slots=True)
class Rerun:
    """Work that is to be done once more."""

    task: str
    problem: Any
    stop_at: int | None
    """The question whether to stop that is answered with yes, as are all later ones; ``None`` for
    none."""


def run(again: Rerun, report: Callable[[Any], None], is_cancelled: Callable[[], bool]) -> Any:  # noqa: ANN401 - the task's own result
    """Return what the task leaves this time."""
    module, _, name = again.task.partition(":")
    work: Callable[..., Any] = getattr(importlib.import_module(module), name)
    asked = 0

    def stops() -> bool:
        nonlocal asked
        asked += 1
        return is_cancelled() or (again.stop_at is not None and asked >= again.stop_at)

    return work(again.problem, report, stops)
