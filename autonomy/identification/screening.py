"""Leaves out the parts of a recording that the model cannot explain, and says so.

A kick of the tail between two reports, a touch of the wall or a turn at the surface is in no model;
it spoils the segment that it falls in, and through the fit all parameters.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification import least_squares
from autonomy.identification.least_squares import Descent
from autonomy.identification.nuisance import segment_costs
from autonomy.identification.problem import Problem, Workers, problem_from
from autonomy.identification.recording import Reason, Segment

OUTLIER = 6.0
QUIET = 0.1
"""A part whose mean squared residual is beyond ``OUTLIER`` times that of the best quarter, or of
this where filters on board made the recording quieter than its sensors, is not explained."""

Cut = tuple[int, int, int]
"""Rows ``first`` to ``stop`` of segment ``number``: all of it, or the half that is kept."""


def whole(problem: Problem) -> tuple[Cut, ...]:
    """Return all segments of a problem uncut."""
    return tuple((k, 0, part.rows.size) for k, part in enumerate(problem.report.segments))


def segment_means(problem: Problem, point: Descent, workers: Workers) -> FloatArray:
    """Return the mean squared weighted residual of each segment, shape ``(segments,)``."""
    predicted, _ = problem.simulate(point.u[None], point.initial[None], workers)
    total = segment_costs(problem, problem.residual(predicted[0]), point.initial)
    rows = problem.layout.segment_row
    seen = np.add.reduceat(np.count_nonzero(problem.layout.weight, axis=1), rows[:-1])
    return total / seen


def explained(cost: FloatArray) -> tuple[bool, ...]:
    """Tell which segments, of costs ``(segments,)``, fit about as well as the best quarter."""
    good = cost <= OUTLIER * max(float(np.quantile(cost, 0.25)), QUIET)
    return tuple(bool(one) for one in good)


def screened(
    problem: Problem, cuts: Sequence[Cut], point: Descent, workers: Workers
) -> tuple[Cut, ...]:
    """Return what to go on with: the explained segments, and halves of those that are not.

    A segment too short to be halved is dropped.

    Args:
        problem: The fit to the segments in ``cuts``.
        cuts: What is used now.
        point: Where the descent ended.
        workers: Threads.
    """
    kept: list[Cut] = []
    shortest_s = problem.config.rules.shortest_segment_s
    good = explained(segment_means(problem, point, workers))
    for cut, part, is_good in zip(cuts, problem.report.segments, good, strict=True):
        if is_good:
            kept.append(cut)
        elif part.duration_s >= 2.0 * shortest_s:
            kept += _halves(cut, problem.recording.time_s[part.rows])
    return tuple(kept)


def _halves(cut: Cut, time_s: FloatArray) -> tuple[Cut, ...]:
    number, first, stop = cut
    middle = first + int(np.searchsorted(time_s, 0.5 * (time_s[0] + time_s[-1])))
    return tuple(
        (number, begin, end) for begin, end in ((first, middle), (middle, stop)) if end - begin >= 2
    )


def reduced(problem: Problem, cuts: Sequence[Cut]) -> Problem:
    """Return the fit to some parts of its segments; the others are told as left out.

    Args:
        problem: The fit to all segments.
        cuts: What to keep of them.
    """
    if tuple(cuts) == whole(problem):
        return problem
    time_s = problem.recording.time_s
    parts: list[Segment] = []
    for number, first, stop in cuts:
        rows = problem.report.segments[number].rows[first:stop]
        parts.append(Segment(rows, float(time_s[rows[0]]), float(time_s[rows[-1]])))
    left_out = (*problem.report.left_out, *_left_out(problem, cuts))
    report = replace(
        problem.report,
        segments=tuple(parts),
        left_out=tuple(sorted(left_out, key=lambda reason: (reason.start_s, reason.end_s))),
    )
    return problem_from(
        problem.vehicle, problem.recording, problem.config, sought=problem.sought, report=report
    )


def _left_out(problem: Problem, cuts: Sequence[Cut]) -> list[Reason]:
    found: list[Reason] = []
    for number, part in enumerate(problem.report.segments):
        used = np.zeros(part.rows.size, dtype=np.bool_)
        for _, first, stop in (cut for cut in cuts if cut[0] == number):
            used[first:stop] = True
        edges = np.flatnonzero(np.diff(np.concatenate([[1], used, [1]]).astype(np.int64)))
        at = problem.recording.time_s[part.rows]
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            found.append(
                Reason(
                    "unexplained",
                    float(at[begin]),
                    float(at[end - 1]),
                    "the model explains this part far worse than the others: a kick of the tail"
                    " between two reports, a touch, or a turn at the surface",
                )
            )
    return found


def carried(
    cuts: Sequence[Cut], kept: Sequence[Cut], problem: Problem, point: Descent, workers: Workers
) -> Descent:
    """Return where a descent goes on after some segments went.

    Args:
        cuts: Segments of the point.
        kept: Segments of the new fit.
        problem: The new fit.
        point: Where the descent stands.
        workers: Threads.

    Raises:
        DivergedError: If the model cannot follow what is left.
    """
    place = {cut: k for k, cut in enumerate(cuts)}
    start = problem.guess.copy()
    for k, cut in enumerate(kept):
        if cut in place:
            start[k] = point.initial[place[cut]]
    initial = least_squares.best_settled(problem, point.u, (start,), workers)
    if initial is None:
        raise least_squares.DivergedError("the model cannot follow what is left of the recording")
    return least_squares.at(problem, point.u, initial, workers, steps=point.steps)
