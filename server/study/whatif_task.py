"""Tries controllers in one scenario on the same seeds."""

from collections.abc import Callable

from autonomy.campaign import CampaignCancelledError, ClusterError
from autonomy.control.feasibility import InfeasibleReferenceError
from autonomy.whatif.check import UnfitControllerError, check_scenario
from autonomy.whatif.comparison import compare
from autonomy.whatif.result import ComparisonResult
from autonomy.whatif.work import TooMuchWorkError
from server.base.study import Refusal
from server.study.task import WhatIfProblem

POINTS_MAX = 400


def check(
    problem: WhatIfProblem, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> Refusal | None:
    """Tell whether the vehicle can follow the reference, and the station work it out in time.

    A refusal names the limit and the field.
    """
    del report, is_cancelled
    try:
        check_scenario(problem.vehicle, problem.scenario, problem.controllers)
    except InfeasibleReferenceError as error:
        return _refusal(error, "scenario", "reference")
    except TooMuchWorkError as error:
        return _refusal(error, "scenario", "runs")
    except UnfitControllerError as error:
        return _refusal(error, "controllers", error.number, "config", "mass_delay_s")
    return None


def run(
    problem: WhatIfProblem,
    report: Callable[[tuple[float, str]], None],
    is_cancelled: Callable[[], bool],
) -> ComparisonResult | Refusal:
    """Return the comparison."""
    try:
        found = compare(
            problem.vehicle,
            problem.scenario,
            problem.controllers,
            flow=problem.flow,
            report=lambda share, message: report((share, message)),
            is_cancelled=is_cancelled,
        )
    except CampaignCancelledError:
        return Refusal("The comparison was cancelled.")
    except ClusterError as error:
        return Refusal(str(error))
    return found.result(max_points=POINTS_MAX)


def _refusal(error: Exception, *loc: str | int) -> Refusal:
    text = str(error)
    return Refusal(f"{text[0].upper()}{text[1:]}.", loc)
