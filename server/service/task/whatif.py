"""Tries controllers in one scenario on the same seeds."""

from collections.abc import Callable
from typing import Any

from autonomy.control.feasibility import InfeasibleReferenceError
from autonomy.trial.check import check_scenario
from autonomy.trial.comparison import TrialCancelledError, compare
from autonomy.trial.run import ControllerChoice
from server.service.task.study import Refusal, WhatIfProblem

POINTS_MAX = 400


def check(
    problem: WhatIfProblem, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> Refusal | None:
    """Tell whether the vehicle can follow the reference at all; a refusal names the limit."""
    del report, is_cancelled
    kinds = {controller.kind for controller in problem.controllers}
    try:
        check_scenario(problem.vehicle, problem.scenario, kinds)
    except InfeasibleReferenceError as error:
        text = str(error)
        return Refusal(f"{text[0].upper()}{text[1:]}.")
    return None


def run(
    problem: WhatIfProblem,
    report: Callable[[tuple[float, str]], None],
    is_cancelled: Callable[[], bool],
) -> dict[str, Any] | Refusal:
    """Return the comparison for JSON."""
    choices = [ControllerChoice(one.kind, one.title, one.config) for one in problem.controllers]
    try:
        found = compare(
            problem.vehicle,
            problem.scenario,
            choices,
            report=lambda share, message: report((share, message)),
            is_cancelled=is_cancelled,
        )
    except TrialCancelledError:
        return Refusal("The comparison was cancelled.")
    return found.document(max_points=POINTS_MAX)
