"""Gauss-Newton's equations of a fit: what each segment says of parameters and initial state."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification.nuisance import state_sensitivity, weighted_slope
from autonomy.identification.problem import Problem, Workers

_PARAMETER_STEP = 1e-4
"""Step of the central differences, as a part of a parameter's scale."""


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """Gauss-Newton's equations of one segment, in the parameters and its initial state."""

    parameters: FloatArray
    """Shape ``(n, n)``."""
    parameter_pull: FloatArray
    """Half the gradient, shape ``(n,)``."""
    state: FloatArray
    """With the prior, shape ``(12, 12)``."""
    state_pull: FloatArray
    """With the prior, shape ``(12,)``."""
    cross: FloatArray
    """Shape ``(12, n)``."""

    def eliminated(self, damping: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Eliminate the initial state by the Schur complement.

        Args:
            damping: By which part the diagonal of the state's block is raised.

        Returns:
            Matrix ``(n, n)`` and half the gradient ``(n,)`` of the parameters alone, and the
            matrix ``(12, n + 1)`` that gives the state's step: ``-(M[:, 0] + M[:, 1:] du)``.
        """
        hessian = self.state.copy()
        hessian[np.diag_indices(12)] *= 1.0 + damping
        both = np.column_stack([self.state_pull, self.cross])
        follow = np.asarray(np.linalg.solve(hessian, both), dtype=np.float64)
        return (
            self.parameters - self.cross.T @ follow[:, 1:],
            self.parameter_pull - self.cross.T @ follow[:, 0],
            follow,
        )


@dataclass(frozen=True, slots=True)
class Information:
    """What the data say about the parameters at one point, the initial states being unknown too."""

    fisher: FloatArray
    """Information matrix in units of the scales, shape ``(n, n)``."""
    gradient: FloatArray
    """Half the gradient of the sum of squares, shape ``(n,)``."""
    fisher_by_segment: FloatArray
    """Its parts, shape ``(segments, n, n)``."""
    gradient_by_segment: FloatArray
    """Its parts, shape ``(segments, n)``."""

    @classmethod
    def of(cls, equations: Sequence[NormalEquations]) -> Self:
        """Return what the data tell of the parameters alone."""
        eliminated = [segment.eliminated(0.0) for segment in equations]
        fisher = np.array([part[0] for part in eliminated])
        gradient = np.array([part[1] for part in eliminated])
        return cls(fisher.sum(axis=0), gradient.sum(axis=0), fisher, gradient)


def normal_equations(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers
) -> tuple[NormalEquations, ...] | None:
    """Return the normal equations of each segment at one point.

    Args:
        problem: The fit.
        u: Shape ``(n,)``.
        initial: Shape ``(segments, 12)``.
        workers: Threads.

    Returns:
        One set for each segment; None if the model diverges.
    """
    found: list[NormalEquations] = []
    for places, part in problem.pieces():
        equations = _equations(part, u, initial[places], workers)
        if equations is None:
            return None
        found += equations
    return tuple(found)


def _equations(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers
) -> list[NormalEquations] | None:
    by_state = state_sensitivity(problem, u, initial, workers)
    if by_state is None:
        return None
    by_parameter = _parameter_sensitivity(problem, u, initial, workers)
    residual, slope = by_state
    rows = problem.layout.segment_row
    found: list[NormalEquations] = []
    for s in range(problem.layout.segments):
        part = slice(rows[s], rows[s + 1])
        r, jx = residual[part].ravel(), slope[part].reshape(-1, 12)
        jp = by_parameter[part].reshape(-1, u.size)
        found.append(
            NormalEquations(
                jp.T @ jp,
                jp.T @ r,
                jx.T @ jx + np.diag(problem.precision),
                jx.T @ r + problem.precision * (initial[s] - problem.guess[s]),
                jx.T @ jp,
            )
        )
    return found


def _parameter_sensitivity(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers
) -> FloatArray:
    """Return derivatives of the weighted residuals by the unknowns, shape ``(rows, 6, n)``."""
    n = u.size
    moved = np.repeat(u[None], 2 * n, axis=0)
    moved[np.arange(n), np.arange(n)] += _PARAMETER_STEP
    moved[n + np.arange(n), np.arange(n)] -= _PARAMETER_STEP
    starts = np.repeat(initial[None], 2 * n, axis=0)
    predicted, _ = problem.simulate(moved, starts, workers)
    return weighted_slope(problem, predicted[:n], predicted[n:], _PARAMETER_STEP)
