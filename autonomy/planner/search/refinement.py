"""Refinement of the best trajectories, compiled: what is staged tried in two gaps at once.

Every proposal for the one gap is combined with every one for the other, and with what was there.
Upper bounds rule out most of the combinations; the others are evaluated, most promising first.
An objective that does not count is None, which numba resolves when it compiles.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.planner.graph import (
    BEFORE,
    CANDIDATES,
    DEPTH_MAX,
    ELITE,
    FIRST_A,
    FULL_SHARE,
    PROPOSALS,
    SHARES,
    STAGED,
    TAKEN_A,
    Graph,
    Int32Array,
    first_staged,
)
from autonomy.planner.information.columns import whiten
from autonomy.planner.information.information import Information
from autonomy.planner.information.refinement import (
    condition_on_rest,
    gain_of_pair,
    gains_given_rest,
)
from autonomy.planner.search.elite import (
    elite_edge,
    elite_place,
    fill_gaps,
    in_gap,
    rank,
    write_elite,
)
from autonomy.planner.search.ergodic_kernel import (
    Ergodic,
    bound_of,
    measure,
    measure_with,
    prepare_pieces,
    spread,
)
from autonomy.planner.search.growth import copy_written
from autonomy.planner.search.weighted import Worth


@kernel
def refine(
    graph: Graph,
    info: Information | None,
    ergodic: Ergodic | None,
    worth: Worth,
    edges: Int32Array,
) -> None:
    """Fill the gaps in an elite trajectory with the best staged proposals, if that is better."""
    pieces = graph.tally[PROPOSALS]
    gain = np.zeros(pieces + 2)
    rest_gain, constant = 0.0, 0.0
    if info is not None:
        whiten(graph, info)
        rest_gain = condition_on_rest(graph, info)
        gains_given_rest(graph, info, gain)
    if ergodic is not None:
        spread(graph, ergodic)
        constant = prepare_pieces(graph, ergodic)
    share = _piece_shares(graph)
    before = graph.tally[BEFORE]
    spent = np.empty((before + 1, pieces - before + 1))
    bound = np.empty(spent.shape)
    for i in range(before + 1):
        one = i if i < before else pieces
        for j in range(pieces - before + 1):
            other = before + j if before + j < pieces else pieces + 1
            spent[i, j] = _spent(share, pieces + 2, one, other)
            bound[i, j] = -math.inf
            if spent[i, j] > FULL_SHARE or (one == pieces and other == pieces + 1):
                continue
            if spent[i, j] > graph.least_spent:
                graph.tally[CANDIDATES] += 1
            value = worth.constant
            if info is not None:
                value += worth.gain_weight * (rest_gain + gain[one] + gain[other])
            if ergodic is not None:
                above = bound_of(ergodic, constant, pieces + 2, one, other)
                value += worth.measure_weight * above
            bound[i, j] = rank(graph, spent[i, j], value)
    _take_best(graph, info, ergodic, worth, edges, rest_gain, gain, spent, bound)


@kernel
def revalue(
    graph: Graph, info: Information | None, ergodic: Ergodic | None, worth: Worth, elite: int
) -> None:
    """Find the worth of an elite trajectory that came from elsewhere."""
    graph.tally[STAGED], graph.tally[PROPOSALS], graph.tally[BEFORE] = 0, 0, 0
    graph.gap[:] = 0
    graph.gap[ELITE] = elite
    value = worth.constant
    if info is not None:
        info.stack.begin[0] = 0
        value += worth.gain_weight * condition_on_rest(graph, info)
    if ergodic is not None:
        prepare_pieces(graph, ergodic)
        value += worth.measure_weight * measure(ergodic, ergodic.rest)
    spent = 0.0
    for i in range(SHARES):
        spent = max(spent, graph.elite_share[elite, i])
    graph.elite_worth[elite] = rank(graph, spent, value)


@inner_kernel
def _take_best(
    graph: Graph,
    info: Information | None,
    ergodic: Ergodic | None,
    worth: Worth,
    edges: Int32Array,
    rest_gain: float,
    gain: FloatArray,
    spent: FloatArray,
    bound: FloatArray,
) -> None:
    """Evaluate combinations in the order of their bounds until none can be better."""
    elite, before, pieces = graph.gap[ELITE], graph.tally[BEFORE], graph.tally[PROPOSALS]
    best, chosen = float(graph.elite_worth[elite]), -1
    flat, columns = bound.ravel(), bound.shape[1]
    while True:
        place = int(np.argmax(flat))
        if flat[place] <= best:
            break
        flat[place] = -math.inf
        i, j = place // columns, place % columns
        one = i if i < before else pieces
        other = before + j if before + j < pieces else pieces + 1
        value = worth.constant
        if info is not None:
            value += worth.gain_weight * (rest_gain + gain_of_pair(info, gain, one, other))
        if ergodic is not None:
            value += worth.measure_weight * measure_with(ergodic, one, other)
        ranked = rank(graph, float(spent[i, j]), value)
        if ranked > best:
            best, chosen = ranked, place
    if chosen < 0:
        return
    one, other = chosen // columns, before + chosen % columns
    length = fill_gaps(graph, one if one < before else -1, other if other < pieces else -1, edges)
    if length <= DEPTH_MAX and elite_place(graph, edges, length, best, elite) == elite:
        write_elite(graph, elite, edges, length, best)
        copy_written(graph, info, ergodic, length)


@inner_kernel
def _piece_shares(graph: Graph) -> FloatArray:
    """Return what each proposal, what each may replace, and the rest spend."""
    pieces, elite = graph.tally[PROPOSALS], graph.gap[ELITE]
    share = np.zeros((pieces + 3, SHARES))
    for piece in range(pieces):
        for staged in range(graph.proposal[piece], graph.proposal[piece + 1]):
            share[piece] += graph.edge_share[first_staged(graph) + staged]
    for i in range(graph.elite_length[elite]):
        number = pieces + 2
        if in_gap(graph, i):
            in_a = 0 <= i - graph.gap[FIRST_A] < graph.gap[TAKEN_A]
            number = pieces if in_a else pieces + 1
        share[number] += graph.edge_share[elite_edge(graph, elite, i)]
    return share


@inner_kernel
def _spent(share: FloatArray, rest: int, one: int, other: int) -> float:
    """Return the greatest share that the rest and two pieces spend."""
    greatest = 0.0
    for k in range(SHARES):
        greatest = max(greatest, share[rest, k] + share[one, k] + share[other, k])
    return greatest
