"""Removes the unknown initial states from a fit: sensitivities, projection and refinement."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification import kernel
from autonomy.identification.problem import Problem, Workers
from autonomy.identification.unknown import packed_candidates

_STATE_STEP = np.array([1e-2, 1e-2, 1e-2, *(1e-4,) * 9])
"""Steps of the central differences in the initial state; truncation and rounding both far below
the noise."""
_WINDOW_S = 12.0
"""The initial states are first sought in the beginning of each segment: over a whole segment,
wrong parameters would lead them astray."""
_WINDOW_TRUST = 0.25
"""Weight of what the beginning says of the initial states when the whole segment is projected: a
linear change that the beginning contradicts is not believed."""
_REFINEMENTS = 20
_PARTS_A_PLACE = 2
"""So many parts of a swarm for each place of a cluster: the slowest holds up the rest less."""
_FIRST_DAMPING = 1e-2


@dataclass(frozen=True, slots=True)
class Profile:
    """Initial states, and the directions in which a change of them moves the residuals."""

    initial: FloatArray
    """Shape ``(segments, 12)``."""
    basis: FloatArray
    """Sensitivities of the weighted residuals, made orthonormal, shape ``(rows, 6, 12)``."""
    lean: FloatArray
    """What the prior adds in each direction, shape ``(segments, 12)``."""
    constant: float
    """Sum of squares of the initial states against their prior."""


def costs(problem: Problem, u: FloatArray, profile: Profile, workers: Workers) -> FloatArray:
    """Return the cost of each candidate, with the best initial states to first order.

    Args:
        problem: The fit.
        u: Candidates in units of the scales, shape ``(m, n)``.
        profile: Where the initial states are, and how they act.
        workers: Threads.

    Returns:
        Mean squared weighted residual, shape ``(m,)``; near 1 at the truth.

    Raises:
        ClusterError: If the cluster went away.
    """
    if workers.cluster is not None:
        parts = np.array_split(u, min(len(u), _PARTS_A_PLACE * workers.cluster.places))
        return np.concatenate(workers.cluster.run(_costs_there, (problem, profile), parts))
    packed, offsets = packed_candidates(problem.vehicle, problem.sought, u)
    found = np.empty(u.shape[0])
    layout = problem.layout

    def run(first: int, stop: int) -> None:
        part = slice(first, stop)
        kernel.costs_into(
            packed[part],
            offsets[part],
            profile.initial,
            problem.config.model == "extended",
            *layout.nodes,
            layout.segment_row,
            layout.measured,
            layout.weight,
            profile.basis,
            profile.lean,
            profile.constant,
            found[part],
        )

    workers.share(run, u.shape[0])
    return np.where(found >= kernel.DIVERGED, kernel.DIVERGED, found / problem.degrees)


def _costs_there(fit: tuple[Problem, Profile], u: FloatArray) -> FloatArray:
    """Return the costs of some candidates on one machine of a cluster."""
    with Workers(1) as alone:
        problem, profile = fit
        return costs(problem, u, profile, alone)


def state_sensitivity(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers
) -> tuple[FloatArray, FloatArray] | None:
    """Return weighted residuals and their derivatives by the initial state of their segment.

    Args:
        problem: The fit.
        u: One candidate, shape ``(n,)``.
        initial: Shape ``(segments, 12)``.
        workers: Threads.

    Returns:
        Residuals ``(rows, 6)`` and derivatives ``(rows, 6, 12)``; None if the candidate diverges.
    """
    moved = np.repeat(initial[None], 25, axis=0)
    for k in range(12):
        moved[1 + 2 * k, :, k] += _STATE_STEP[k]
        moved[2 + 2 * k, :, k] -= _STATE_STEP[k]
    predicted, sound = problem.simulate(np.repeat(u[None], 25, axis=0), moved, workers)
    if not sound[0]:
        return None
    steps = _STATE_STEP[:, None, None]
    slope = weighted_slope(problem, predicted[1::2], predicted[2::2], steps)
    return problem.residual(predicted[0]), slope


def weighted_slope(
    problem: Problem, up: FloatArray, down: FloatArray, step: FloatArray | float
) -> FloatArray:
    """Return central differences of the weighted residuals, shape ``(rows, 6, m)``.

    What follows a divergence of a neighbour is 0: nothing is known of it.

    Args:
        problem: The fit.
        up: Predictions one step up, shape ``(m, rows, 6)``.
        down: Predictions one step down, likewise.
        step: Length of a step.
    """
    slope = np.moveaxis((up - down) / (2.0 * step), 0, -1)
    weight = problem.layout.weight[..., None]
    return np.where((weight > 0.0) & np.isfinite(slope), slope * weight, 0.0)


def refined(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers, *, whole: bool
) -> FloatArray | None:
    """Find the best initial states of one candidate.

    Each segment descends by itself: its damping grows when a step fails and falls when it helps.

    Args:
        problem: The fit.
        u: The candidate, shape ``(n,)``.
        initial: Where to start, shape ``(segments, 12)``.
        workers: Threads.
        whole: Whether to fit whole segments instead of their beginnings.

    Returns:
        Shape ``(segments, 12)``; None if the candidate diverges from the start.
    """
    found: list[FloatArray] = []
    for places, part in problem.pieces():
        best = _refined(part, u, initial[places], workers, whole=whole)
        if best is None:
            return None
        found.append(best)
    return np.concatenate(found)


def _refined(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers, *, whole: bool
) -> FloatArray | None:
    mask = 1.0 if whole else _beginning(problem)
    best = initial.copy()
    found = state_sensitivity(problem, u, best, workers)
    if found is None:
        return None
    damping = np.full(best.shape[0], _FIRST_DAMPING)
    totals = segment_costs(problem, found[0] * mask, best)
    idle = 0
    for _ in range(_REFINEMENTS):
        tried = best + _damped_steps(problem, found, mask, best, damping)
        predicted, _ = problem.simulate(u[None], tried[None], workers)
        trial = segment_costs(problem, problem.residual(predicted[0]) * mask, tried)
        better = trial < totals
        best[better] = tried[better]
        damping = np.where(better, damping * 0.1, damping * 10.0)
        gained = float(np.sum((totals - trial)[better]))
        totals = np.where(better, trial, totals)
        if better.any():
            moved = state_sensitivity(problem, u, best, workers)
            if moved is None:
                break
            found = moved
        idle = idle + 1 if gained < 1e-4 * float(totals.sum()) else 0
        if idle == 3:
            break
    return best


def profile_of(problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers) -> Profile:
    """Return how given initial states act for one candidate.

    Where the candidate diverges they act not at all, and only the prior counts.

    Args:
        problem: The fit.
        u: Unknowns in units of their scales, shape ``(n,)``.
        initial: Initial states, shape ``(segments, 12)``.
        workers: Threads.
    """
    shape = (*problem.layout.measured.shape, 12)
    basis, lean = np.empty(shape), np.empty_like(initial)
    away = initial - problem.guess
    for places, part in problem.pieces():
        rows = slice(
            problem.layout.segment_row[places.start], problem.layout.segment_row[places.stop]
        )
        found = state_sensitivity(part, u, initial[places], workers)
        slope = np.zeros((rows.stop - rows.start, 6, 12)) if found is None else found[1]
        _orthonormal(part, slope, away[places], basis[rows], lean[places])
    return Profile(initial, basis, lean, float(np.sum(problem.precision * away**2)))


def _orthonormal(
    problem: Problem, slope: FloatArray, away: FloatArray, basis: FloatArray, lean: FloatArray
) -> None:
    """Write ``basis`` and ``lean`` of a profile for some segments."""
    early = slope * _beginning(problem)[..., None]
    rows = problem.layout.segment_row
    for s in range(problem.layout.segments):
        part = slice(rows[s], rows[s + 1])
        jacobian, start = slope[part].reshape(-1, 12), early[part].reshape(-1, 12)
        hessian = jacobian.T @ jacobian + _WINDOW_TRUST * start.T @ start
        root = np.linalg.cholesky(hessian + np.diag(problem.precision))
        basis[part] = np.linalg.solve(root, jacobian.T).T.reshape(slope[part].shape)
        lean[s] = np.linalg.solve(root, problem.precision * away[s])


def _beginning(problem: Problem) -> FloatArray:
    """Return 1 for the rows of each segment's beginning and 0 for the others, ``(rows, 1)``."""
    layout = problem.layout
    counts = np.diff(layout.segment_row)
    start = np.repeat(layout.time_s[layout.segment_row[:-1]], counts)
    return (layout.time_s - start <= _WINDOW_S).astype(np.float64)[:, None]


def segment_costs(problem: Problem, residual: FloatArray, initial: FloatArray) -> FloatArray:
    """Return each segment's sum of squares with its prior, infinite where it diverged.

    Args:
        problem: The fit.
        residual: Weighted, shape ``(rows, 6)``.
        initial: Initial states, shape ``(segments, 12)``.

    Returns:
        Shape ``(segments,)``.
    """
    rows = problem.layout.segment_row
    squares = np.add.reduceat(np.sum(residual**2, axis=1), rows[:-1])
    prior = np.sum(problem.precision * (initial - problem.guess) ** 2, axis=1)
    return np.where(np.isfinite(squares), squares + prior, np.inf)


def _damped_steps(
    problem: Problem,
    found: tuple[FloatArray, FloatArray],
    mask: FloatArray | float,
    initial: FloatArray,
    damping: FloatArray,
) -> FloatArray:
    """Return Levenberg-Marquardt steps of the initial states, shape ``(segments, 12)``."""
    residual, slope = found[0] * mask, found[1] * np.asarray(mask)[..., None]
    rows = problem.layout.segment_row
    steps = np.empty_like(initial)
    for s in range(problem.layout.segments):
        part = slice(rows[s], rows[s + 1])
        jacobian = slope[part].reshape(-1, 12)
        hessian = jacobian.T @ jacobian + np.diag(problem.precision)
        gradient = jacobian.T @ residual[part].ravel()
        gradient += problem.precision * (initial[s] - problem.guess[s])
        hessian[np.diag_indices(12)] *= 1.0 + damping[s]
        steps[s] = -np.linalg.solve(hessian, gradient)
    return steps
