"""Says by how much a robot's trim is off, from its last dives."""

from collections.abc import Callable

from pydantic import ValidationError

from autonomy.identification.trim_advice import NoAdviceError, advise
from autonomy.vehicle.trim import TrimAdvice
from server.base.study import Refusal
from server.study.task import TrimProblem


def run(
    problem: TrimProblem, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> TrimAdvice | Refusal:
    """Return the advice, or why there is none."""
    del report, is_cancelled
    try:
        return advise(problem.vehicle, problem.recording, problem.present, dives=problem.dives)
    except NoAdviceError as error:
        text = str(error)
        return Refusal(f"{text[0].upper()}{text[1:]}.")
    except ValidationError:
        # Of a vehicle with long travel, what the dives tell may be more than a trim can hold.
        return Refusal("The robot is off by more than a trim can hold; mend its ballast first.")
