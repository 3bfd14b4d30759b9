"""The search for the most likely hyperparameters, from several starts."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.field.learning.likelihood import Evaluation, MarginalLikelihood
from autonomy.field.learning.prior import LogNormalPrior

Report = Callable[[float, str], None]
"""Takes the share of the work that is done and a sentence."""
IsCancelled = Callable[[], bool]

_SCREENING_ITERATIONS = 20
"""Iterations that each of several starts gets before only the best goes on."""
_TOLERANCE = 1e-4
"""The search ends when a step promises or brings less than this, in nats."""
_FIRST_DAMPING = 1e-2
_LEAST_GAIN = 1e-3
"""Smallest share of what a step promised that lets it be taken."""
_LEAST_INFORMATION = 1e-9
_LONGEST_STEP = 2.0
"""No hyperparameter changes by more than this factor's logarithm at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Where hyperparameters may go, and how long the search may take."""

    lower: FloatArray
    """Logarithms of the smallest hyperparameters, shape ``(p,)``."""
    upper: FloatArray
    """Logarithms of the largest hyperparameters, shape ``(p,)``."""
    held: BoolArray
    """Hyperparameters that stay as in each start, shape ``(p,)``."""
    max_iterations: int = 100


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """End of a search."""

    log_parameters: FloatArray
    """Shape ``(p,)``."""
    likelihood: Evaluation
    converged: bool
    message: str
    """How the search ended, for a person."""


class _CancelledError(Exception):
    """Leaves the optimizer when the search is cancelled."""


def search(
    likelihood: MarginalLikelihood,
    starts: Sequence[FloatArray],
    limits: Limits,
    prior: LogNormalPrior,
    *,
    report: Report | None = None,
    is_cancelled: IsCancelled | None = None,
) -> Found:
    """Find the hyperparameters of the greatest posterior density.

    Damped scoring: Newton's steps with the average information in place of the second
    derivatives, which makes them downhill everywhere and needs few evaluations.
    Several starts get a few iterations each; the best of what they found is then followed.

    Args:
        likelihood: Of the data.
        starts: Logarithms of hyperparameters, each of shape ``(p,)``; brought inside the limits.
        limits: Box, held hyperparameters and number of iterations.
        prior: Density of the hyperparameters themselves.
        report: Told after each evaluation.
        is_cancelled: Asked before each evaluation; once it says yes, the best so far is the end.

    Raises:
        ValueError: If no start has a likelihood.
    """
    walk = _Walk(likelihood, prior, limits, len(starts), report, is_cancelled)
    converged = False
    try:
        for start in starts if len(starts) > 1 else ():
            walk.follow(start, min(_SCREENING_ITERATIONS, limits.max_iterations))
        converged = walk.follow(walk.best_or(starts[0]), limits.max_iterations)
        message = (
            f"converged after {walk.evaluations} evaluations"
            if converged
            else f"stopped after {limits.max_iterations} iterations, before it converged"
        )
    except _CancelledError:
        message = "cancelled; this is the best that was found until then"
    best = walk.best_or(starts[0])
    return Found(best, walk.best_likelihood or likelihood.at(best), converged, message)


class _Walk:
    """Evaluates, and remembers the best that was seen."""

    def __init__(
        self,
        likelihood: MarginalLikelihood,
        prior: LogNormalPrior,
        limits: Limits,
        starts: int,
        report: Report | None,
        is_cancelled: IsCancelled | None,
    ) -> None:
        screening = starts * _SCREENING_ITERATIONS if starts > 1 else 0
        self._expected = screening + 0.5 * limits.max_iterations
        self._likelihood = likelihood
        self._prior = prior
        self._limits = limits
        self._report = report
        self._is_cancelled = is_cancelled
        self._best: FloatArray | None = None
        self._best_value = math.inf
        self.best_likelihood: Evaluation | None = None
        self.evaluations = 0

    def best_or(self, start: FloatArray) -> FloatArray:
        """Return the best hyperparameters so far, or ``start`` inside the limits."""
        if self._best is None:
            return np.clip(start, self._limits.lower, self._limits.upper)
        return self._best

    def follow(self, start: FloatArray, iterations: int) -> bool:
        """Descend from ``start``; return whether the descent ended by itself."""
        limits = self._limits
        here = np.clip(start, limits.lower, limits.upper)
        reached = self._evaluate(here)
        if reached is None:
            return False
        state = self._state(here, reached)
        damping = _FIRST_DAMPING
        for _ in range(iterations):
            pushed_out = ((here <= limits.lower) & (state.gradient > 0.0)) | (
                (here >= limits.upper) & (state.gradient < 0.0)
            )
            step = _damped_step(state, ~(limits.held | pushed_out), damping)
            there = np.clip(here + step, limits.lower, limits.upper)
            expected = state.expected_gain(there - here)
            if expected < _TOLERANCE:
                return True
            reached = self._evaluate(there)
            gain = -math.inf if reached is None else (state.value - reached.posterior) / expected
            if reached is None or gain < _LEAST_GAIN:
                damping *= 4.0
                continue
            if damping <= 1.0 and state.value - reached.posterior < _TOLERANCE:
                return True
            here, state = there, self._state(there, reached)
            damping *= 0.2 if gain > 0.75 else 1.0 if gain > 0.25 else 2.0
        return False

    def _evaluate(self, log_parameters: FloatArray) -> "_Reached | None":
        if self._is_cancelled is not None and self._is_cancelled():
            raise _CancelledError
        self.evaluations += 1
        try:
            likelihood = self._likelihood.at(log_parameters)
        except ValueError:
            return None
        posterior = likelihood.value + self._prior.penalty(log_parameters)[0]
        if posterior < self._best_value:
            self._best_value, self._best = posterior, log_parameters.copy()
            self.best_likelihood = likelihood
        if self._report is not None:
            share = 1.0 - math.exp(-self.evaluations / self._expected)
            self._report(share, f"negative log likelihood {likelihood.value:.2f}")
        return _Reached(posterior, likelihood)

    def _state(self, log_parameters: FloatArray, reached: "_Reached") -> "_State":
        derivatives = reached.likelihood.derivatives()
        slope = self._prior.penalty(log_parameters)[1]
        information = derivatives.information + self._prior.precision * np.eye(len(slope))
        return _State(reached.posterior, derivatives.gradient + slope, information)


@dataclass(frozen=True, slots=True, eq=False)
class _Reached:
    """Negative log posterior and likelihood of one set of hyperparameters."""

    posterior: float
    likelihood: Evaluation


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """The negative log posterior and its derivatives at one set of hyperparameters."""

    value: float
    gradient: FloatArray
    information: FloatArray

    def expected_gain(self, move: FloatArray) -> float:
        """Return by how much the quadratic model falls."""
        return -float(move @ (self.gradient + 0.5 * self.information @ move))


def _damped_step(state: _State, free: BoolArray, damping: float) -> FloatArray:
    """Return the scoring step of the free hyperparameters, none longer than is believable."""
    step = np.zeros(len(free))
    if not free.any():
        return step
    information = state.information[np.ix_(free, free)]
    diagonal = np.diagonal(information)
    ridge = damping * diagonal + _LEAST_INFORMATION * (1.0 + float(diagonal.max()))
    step[free] = -np.linalg.solve(information + np.diag(ridge), state.gradient[free])
    longest = float(np.max(np.abs(step)))
    return step * min(1.0, _LONGEST_STEP / longest) if longest else step
