"""Information gain of what may fill the gaps of a trajectory, compiled.

The points outside the gaps, the *rest*, are factorized once; everything on the stack is solved
with their factors by products of large matrices. Then the gain of a piece given the rest needs
only the covariance among its own points, and ``gain(rest) + gain(one piece) + gain(other piece)``
is an upper bound on the gain of a trajectory with both. Every piece keeps its factor, so that a
pair costs the covariance between both and one factorization of the second.
"""

import numpy as np
import numpy.typing as npt

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
def gains_given_rest(graph: Graph, info: Information, gain: FloatArray) -> None:
    """Set the gain of each piece given the rest, and keep what pairs of pieces are judged with."""
    rest, stack, count, at = info.rest, info.stack, info.tally[REST], 0
    for piece in range(graph.tally[PROPOSALS] + 2):
        begin, end = _rows_of(info, piece)
        k = end - begin
        gain[piece] = 0.0
        rest.piece_at[piece] = at
        if k == 0:
            continue
        given = rest.piece_given[at : at + k * k].reshape(k, k)
        fill_block(info.covariance, stack.place, begin, stack.place, begin, info.distance, given)
        half_noise = _add_noise(info, piece, given)
        rest.piece_half_noise[piece] = half_noise
        if rest.white.shape[1] > 0:
            _subtract(info, stack.white[begin:end], stack.white[begin:end], given)
        if count > 0:
            solved = rest.solved[begin * count : end * count].reshape(k, count)
            _subtract(info, solved, solved, given)
        upper = rest.pair_covariance[0][: k * k].reshape(k, k)
        inverse = rest.pair_covariance[1][: k * k].reshape(k, k)
        upper[:, :] = given
        gain[piece] = half_log_determinant(upper, k) - half_noise
        invert_upper(upper, inverse)
        rest.piece_inverse[at : at + k * k].reshape(k, k)[:, :] = inverse
        at += k * k


@inner_kernel
def gain_of_pair(info: Information, gain: FloatArray, one: int, other: int) -> float:
    """Return the gain of two pieces, given the rest: that of one, and of the other given one."""
    begin, end = _rows_of(info, one)
    other_begin, other_end = _rows_of(info, other)
    k, m = end - begin, other_end - other_begin
    if k == 0 or m == 0:
        return float(gain[one] + gain[other])
    rest, stack, count = info.rest, info.stack, info.tally[REST]
    cross = rest.pair_cross[: k * m].reshape(k, m)
    fill_block(info.covariance, stack.place, begin, stack.place, other_begin, info.distance, cross)
    if rest.white.shape[1] > 0:
        _subtract(info, stack.white[begin:end], stack.white[other_begin:other_end], cross)
    if count > 0:
        solved = rest.solved[begin * count : end * count].reshape(k, count)
        other_solved = rest.solved[other_begin * count : other_end * count].reshape(m, count)
        _subtract(info, solved, other_solved, cross)
    at, other_at = rest.piece_at[one], rest.piece_at[other]
    inverse = rest.piece_inverse[at : at + k * k].reshape(k, k)
    white = rest.pair_white[: k * m].reshape(k, m)
    np.dot(inverse.T, cross, white)
    given = rest.pair_covariance[0][: m * m].reshape(m, m)
    given[:, :] = rest.piece_given[other_at : other_at + m * m].reshape(m, m)
    _subtract(info, white.T, white.T, given)
    return float(gain[one] + half_log_determinant(given, m) - rest.piece_half_noise[other])


@inner_kernel
def _rows_of(info: Information, piece: int) -> tuple[int, int]:
    """Return the first row of a piece on the stack, and one behind its last."""
    first, last = info.rest.piece_edge[piece]
    return int(info.stack.begin[first]), int(info.stack.begin[last])


@inner_kernel
def _add_noise(info: Information, piece: int, given: FloatArray) -> float:
    """Add the noise of a piece's edges to its covariance; return what it counts by itself."""
    stack, half_noise, at = info.stack, 0.0, 0
    first, last = info.rest.piece_edge[piece]
    for edge in range(first, last):
        k = stack.begin[edge + 1] - stack.begin[edge]
        given[at : at + k, at : at + k] += stack.noise[edge, :k, :k]
        half_noise += stack.half_noise[edge]
        at += k
    return half_noise


@inner_kernel
def _subtract(
    info: Information,
    columns: Float32Array,
    others: Float32Array,
    matrix: npt.NDArray[np.floating],
) -> None:
    """Subtract ``columns others^T``."""
    k, m = len(columns), len(others)
    product = info.rest.pair_product[: k * m].reshape(k, m)
    np.dot(columns, others.T, product)
    matrix -= product
