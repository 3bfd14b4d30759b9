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
            rest.white[count : count + k] = info.white[edge, :k]
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
    fill_block(info.covariance, rest.place, 0, rest.place, 0, info.distance, given)
    half_noise = _add_rest_noise(graph, info, given)
    if rest.white.shape[1] > 0:
        np.dot(rest.white[:count], rest.white[:count].T, among)
        given -= among
    gain = half_log_determinant(given, count) - half_noise
    invert_upper(given, inverse)
    single[:, :] = inverse
    if rows > 0 and rest.white.shape[1] > 0:
        explained = rest.explained[: rows * count].reshape(rows, count)
        np.dot(stack.white[:rows], rest.white[:count].T, explained)
        cross -= explained
    if rows > 0:
        np.dot(cross, single, rest.solved[: rows * count].reshape(rows, count))
    return float(gain)


@inner_kernel
def _add_rest_noise(graph: Graph, info: Information, given: FloatArray) -> float:
    """Add the noise of the rest's edges to their covariance; return what it counts by itself."""
    elite, at, half_noise = graph.gap[ELITE], 0, 0.0
    for i in range(graph.elite_length[elite]):
        if not in_gap(graph, i):
            edge = elite_edge(graph, elite, i)
            k = info.samples[edge]
            given[at : at + k, at : at + k] += info.noise[edge, :k, :k]
            half_noise += info.half_noise[edge]
            at += k
    return half_noise


@inner_kernel
def _stack_own(graph: Graph, info: Information) -> int:
    """Put what the gaps held on the stack too, and note where pieces are; return the rows."""
    stack, rest = info.stack, info.rest
    pieces, number = graph.tally[PROPOSALS], graph.tally[STAGED]
    for piece in range(pieces):
        rest.piece_edge[piece, 0] = graph.proposal[piece]
        rest.piece_edge[piece, 1] = graph.proposal[piece + 1]
    row = int(stack.begin[number])
    for gap in range(2):
        first = graph.gap[FIRST_A] if gap == 0 else graph.gap[FIRST_B]
        taken = graph.gap[TAKEN_A] if gap == 0 else graph.gap[TAKEN_B]
        rest.piece_edge[pieces + gap, 0] = number
        for i in range(first, first + taken):
            edge = elite_edge(graph, graph.gap[ELITE], i)
            k = int(info.samples[edge])
            stack.place[:, row : row + k] = info.place[edge, :, :k]
            stack.noise[number, :k, :k] = info.noise[edge, :k, :k]
            stack.half_noise[number] = info.half_noise[edge]
            stack.white[row : row + k] = info.white[edge, :k]
            row += k
            number += 1
            stack.begin[number] = row
        rest.piece_edge[pieces + gap, 1] = number
    return row


@inner_kernel
def gain_given_rest(info: Information, one: int, other: int) -> float:
    """Return the gain of one or two pieces, given the rest; ``other`` is -1 for one alone."""
    k = _gather(info, one, 0)
    if other >= 0:
        k = _gather(info, other, k)
    if k == 0:
        return 0.0
    rest, count = info.rest, info.tally[REST]
    given = rest.pair_covariance[: k * k].reshape(k, k)
    fill_block(info.covariance, rest.pair_place, 0, rest.pair_place, 0, info.distance, given)
    half_noise, at = _add_noise(info, one, 0, given)
    if other >= 0:
        half_other, _ = _add_noise(info, other, at, given)
        half_noise += half_other
    if rest.white.shape[1] > 0:
        _subtract(info, rest.pair_white[:k], given)
    if count > 0:
        _subtract(info, rest.pair_solved[: k * count].reshape(k, count), given)
    return float(half_log_determinant(given, k) - half_noise)


@inner_kernel
def _add_noise(info: Information, piece: int, at: int, given: FloatArray) -> tuple[float, int]:
    """Add the noise of a piece's edges; return what it counts by itself, and the next row."""
    stack, half_noise = info.stack, 0.0
    first, last = info.rest.piece_edge[piece]
    for edge in range(first, last):
        k = stack.begin[edge + 1] - stack.begin[edge]
        given[at : at + k, at : at + k] += stack.noise[edge, :k, :k]
        half_noise += stack.half_noise[edge]
        at += k
    return half_noise, at


@inner_kernel
def _gather(info: Information, piece: int, at: int) -> int:
    """Copy a piece's points and columns behind ``at`` others; return how many there are now."""
    rest, stack, count = info.rest, info.stack, info.tally[REST]
    first, last = rest.piece_edge[piece]
    begin, end = stack.begin[first], stack.begin[last]
    until = at + end - begin
    rest.pair_place[:, at:until] = stack.place[:, begin:end]
    rest.pair_white[at:until] = stack.white[begin:end]
    rest.pair_solved[at * count : until * count] = rest.solved[begin * count : end * count]
    return int(until)


@inner_kernel
def _subtract(info: Information, columns: Float32Array, matrix: FloatArray) -> None:
    """Subtract ``columns columns^T``."""
    k = len(columns)
    product = info.rest.pair_product[: k * k].reshape(k, k)
    np.dot(columns, columns.T, product)
    matrix -= product
