"""What the actuators may have done between two reports, which nobody saw."""

from dataclasses import replace

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.identification.problem import Problem


def moved_at_once(problem: Problem, *, early: bool) -> Problem:
    """Return the fit with actuators that move at their full rate, as early or late as they may.

    The fit itself takes them to move evenly from one report to the next. The truth lies between
    the two extremes; how far they move the answer is how far it hangs on what was not reported.

    Args:
        problem: The fit.
        early: Whether each movement follows its first report at once or ends just at its second.
    """
    limits = problem.vehicle.limits
    rates = np.array([limits.m0_rate_kg_s, limits.rp1_rate_m_s, limits.delta_rate_rad_s])
    layout = problem.layout
    inputs = layout.node_inputs.copy()
    for s in range(layout.segments):
        part = slice(layout.segment_node[s], layout.segment_node[s + 1])
        at = np.concatenate([[0.0], np.cumsum(layout.node_step_s[part][:-1])])
        seen = np.flatnonzero(layout.node_row[part] >= 0)
        inputs[part] = _moved(at, seen, layout.node_inputs[part], rates, early=early)
    return replace(problem, layout=replace(layout, node_inputs=inputs))


def _moved(
    at: FloatArray, seen: IntArray, even: FloatArray, rates: FloatArray, *, early: bool
) -> FloatArray:
    """Return the inputs of one segment's nodes, shape ``(nodes, 3)``; ``seen`` are its reports."""
    nodes = np.arange(at.size)
    interval = np.clip(np.searchsorted(seen, nodes, side="right") - 1, 0, seen.size - 2)
    begin, end = seen[interval], seen[interval + 1]
    way = even[end] - even[begin]
    width = (at[end] - at[begin])[:, None]
    rate = np.maximum(rates, np.abs(way) / width)
    since, left = (at - at[begin])[:, None], (at[end] - at)[:, None]
    if early:
        return even[begin] + np.sign(way) * np.minimum(np.abs(way), rate * since)
    return even[end] - np.sign(way) * np.minimum(np.abs(way), rate * left)
