"""Information gain of what may fill the gaps of a trajectory, compiled.

The points outside the gaps, the *rest*, are factorized once; everything on the stack is solved
with their factors by products of large matrices. Then the gain of a piece given the rest needs
only the covariance among its own points, and ``gain(rest) + gain(one piece) + gain(other piece)``
is an upper bound on the gain of a trajectory with both.
"""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from autonomy.planner.graph import (
    ELITE,
    FIRST_A,
    FIRST_B,
    PROPOSALS,
    STAGED,
    TAKEN_A,
    TAKEN_B,
    Graph,
)
from autonomy.planner.information.cholesky import half_log_determinant, invert_upper
from autonomy.planner.information.covariance import fill_block
from autonomy.planner.information.information import REST, Float32Array, Information
from autonomy.planner.search.elite import elite_edge, in_gap


@inner_kernel
def condition_on_rest(graph: Graph, info: Information) -> float:
    """Prepare to judge the pieces on the stack; return the gain of the rest."""
    rest, stack, elite = info.rest, info.stack, graph.gap[ELITE]
    count = 0
    for i in range(graph.elite_length[elite]):
        if not in_gap(graph, i):
            edge = elite_edge(graph, elite, i)
            k = info.samples[edge]
            rest.place[:, count : count + k] = info.place[edge, :, :k]
            rest.noise[count : count + k] = info.noise[edge, :k]
            rest.past[count : count + k] = info.white_past[edge, :k]
            rest.test[count : count + k] = info.white_test[edge, :k]
            count += k
    info.tally[REST] = count
    rows = _stack_own(graph, info)
    if count == 0:
        return 0.0
    given = rest.factor[0][: count * count].reshape(count, count)
    inverse = rest.factor[1][: count * count].reshape(count, count)
    single = rest.inverse[: count * count].reshape(count, count)
    among = rest.explained[: count * count].reshape(count, count)
    cross = rest.cross[: rows * count].reshape(rows, count)
    fill_block(info.covariance, stack.place, 0, rest.place, 0, info.distance, cross)
    gain = 0.0
    for part in range(2):
        fill_block(info.covariance, rest.place, 0, rest.place, 0, info.distance, given)
        for i in range(count):
            given[i, i] += rest.noise[i]
        if rest.past.shape[1] > 0:
            np.dot(rest.past[:count], rest.past[:count].T, among)
            given -= among
        if part == 1:
            np.dot(rest.test[:count], rest.test[:count].T, among)
            given -= among
        half = half_log_determinant(given, count)
        gain += half if part == 0 else -half
        invert_upper(given, inverse)
        single[:, :] = inverse
        explained = rest.explained[: rows * count].reshape(rows, count)
        if part == 1:
            np.dot(stack.test[:rows], rest.test[:count].T, explained)
            cross -= explained
        elif rest.past.shape[1] > 0:
            np.dot(stack.past[:rows], rest.past[:count].T, explained)
            cross -= explained
        np.dot(cross, single, rest.solved[part][: rows * count].reshape(rows, count))
    return gain


@inner_kernel
def _stack_own(graph: Graph, info: Information) -> int:
    """Put what the gaps held on the stack too, and note where pieces are; return the rows."""
    stack, rest = info.stack, info.rest
    pieces = graph.tally[PROPOSALS]
    for piece in range(pieces):
        rest.piece_row[piece, 0] = stack.begin[graph.proposal[piece]]
        rest.piece_row[piece, 1] = stack.begin[graph.proposal[piece + 1]]
    row = int(stack.begin[graph.tally[STAGED]])
    for gap in range(2):
        first = graph.gap[FIRST_A] if gap == 0 else graph.gap[FIRST_B]
        taken = graph.gap[TAKEN_A] if gap == 0 else graph.gap[TAKEN_B]
        rest.piece_row[pieces + gap, 0] = row
        for i in range(first, first + taken):
            edge = elite_edge(graph, graph.gap[ELITE], i)
            k = int(info.samples[edge])
            stack.place[:, row : row + k] = info.place[edge, :, :k]
            stack.noise[row : row + k] = info.noise[edge, :k]
            stack.past[row : row + k] = info.white_past[edge, :k]
            stack.test[row : row + k] = info.white_test[edge, :k]
            row += k
        rest.piece_row[pieces + gap, 1] = row
    return row


@inner_kernel
def gain_given_rest(info: Information, one: int, other: int) -> float:
    """Return the gain of one or two pieces, given the rest; ``other`` is -1 for one alone."""
    k = _gather(info, one, 0)
    if other >= 0:
        k = _gather(info, other, k)
    if k == 0:
        return 0.0
    rest = info.rest
    given_past = rest.pair_covariance[0][: k * k].reshape(k, k)
    given_both = rest.pair_covariance[1][: k * k].reshape(k, k)
    fill_block(info.covariance, rest.pair_place, 0, rest.pair_place, 0, info.distance, given_past)
    for i in range(k):
        given_past[i, i] += rest.pair_noise[i]
    if rest.past.shape[1] > 0:
        _subtract(info, rest.pair_past[:k], given_past)
    given_both[:, :] = given_past
    _subtract(info, rest.pair_test[:k], given_both)
    count = info.tally[REST]
    if count > 0:
        _subtract(info, rest.pair_solved[0][: k * count].reshape(k, count), given_past)
        _subtract(info, rest.pair_solved[1][: k * count].reshape(k, count), given_both)
    return half_log_determinant(given_past, k) - half_log_determinant(given_both, k)


@inner_kernel
def _gather(info: Information, piece: int, at: int) -> int:
    """Copy a piece's points and columns behind ``at`` others; return how many there are now."""
    rest, stack, count = info.rest, info.stack, info.tally[REST]
    begin, end = rest.piece_row[piece]
    until = at + end - begin
    rest.pair_place[:, at:until] = stack.place[:, begin:end]
    rest.pair_noise[at:until] = stack.noise[begin:end]
    rest.pair_past[at:until] = stack.past[begin:end]
    rest.pair_test[at:until] = stack.test[begin:end]
    for part in range(2):
        rest.pair_solved[part, at * count : until * count] = rest.solved[
            part, begin * count : end * count
        ]
    return until


@inner_kernel
def _subtract(info: Information, columns: Float32Array, matrix: FloatArray) -> None:
    """Subtract ``columns columns^T``."""
    k = len(columns)
    product = info.rest.pair_product[: k * k].reshape(k, k)
    np.dot(columns, columns.T, product)
    matrix -= product
