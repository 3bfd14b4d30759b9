"""The factor of a covariance that grows by rows, and what it has whitened.

Rows live in panels that are filled and never moved, so that taking in a sample costs the same
whether a panel is full or not. Everything large goes through one BLAS, as it lies in memory.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_blas_funcs

from autonomy.arrays import FloatArray
from autonomy.field.model.algebra import solve_in_place, subtract_product, subtract_vector_product

_gemv, _trsv = get_blas_funcs(("gemv", "trsv"), dtype=np.float64)
"""For one sample: it is soon done."""

PANEL_ROWS = 128
_SPARE_COLUMNS = 256
_TARGET_ROWS = 2 * PANEL_ROWS
"""Rows of a panel of whitened targets. In Fortran order what belongs to one target lies together:
a sample's row is then made by scalar products, which read memory once and write little."""


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """What a factor ``[[L0, 0], [B^T, L]]`` gained by ``m`` samples after ``n``."""

    B: FloatArray
    """Shape ``(n, m)``, C order."""
    L: FloatArray
    """Lower triangular, shape ``(m, m)``, Fortran order."""
    z: FloatArray
    """Whitened values of the new samples, shape ``(m,)``."""


class _Panel:
    """Rows ``start`` to ``start + rows`` of the factor."""

    def __init__(self, start: int) -> None:
        self.start = start
        self.rows = 0
        self.left = np.zeros((PANEL_ROWS, start))
        self.diagonal = np.asfortranarray(np.eye(PANEL_ROWS))
        """Identity where no rows are yet, so that it is solved with as it lies."""


class GrowingFactor:
    """Lower triangular factor of the samples' covariance, ``n`` rows at present."""

    def __init__(self) -> None:
        """Begin without rows."""
        self._panels: list[_Panel] = []
        self._rows = 0

    def __len__(self) -> int:
        """Number of rows."""
        return self._rows

    @property
    def room(self) -> int:
        """Most rows that the next ``append`` may bring."""
        return PANEL_ROWS - self._rows % PANEL_ROWS

    @property
    def memory_bytes(self) -> int:
        """What the rows take, with room for those to come."""
        return sum(panel.left.nbytes + panel.diagonal.nbytes for panel in self._panels)

    def append(self, B: FloatArray, L: FloatArray) -> None:
        """Add the rows ``[B^T, L]``, shapes ``(n, m)`` and ``(m, m)``, at most ``room`` of them."""
        m = len(L)
        if self._rows % PANEL_ROWS == 0:
            self._panels.append(_Panel(self._rows))
        panel = self._panels[-1]
        first, new = panel.rows, slice(panel.rows, panel.rows + m)
        panel.left[new] = B[: panel.start].T
        panel.diagonal[new, :first] = B[panel.start :].T
        panel.diagonal[new, new] = L
        panel.rows += m
        self._rows += m

    def solve(self, right: FloatArray) -> FloatArray:
        """Return ``L^-1 right`` for ``right`` of shape ``(n, k)``, C order."""
        x = np.array(right, order="C")
        for panel in self._panels:
            here = slice(panel.start, panel.start + panel.rows)
            if panel.start:
                _subtract_product(x[here], panel.left[: panel.rows], x[: panel.start])
            block = np.zeros((PANEL_ROWS, x.shape[1]))
            block[: panel.rows] = x[here]
            if x.shape[1] == 1:
                block[:, 0] = _trsv(panel.diagonal, block[:, 0], lower=1, overwrite_x=1)
            else:
                solve_in_place(panel.diagonal, block.T, transposed=True, from_right=True)
            x[here] = block[: panel.rows]
        return x


class WhitenedColumns:
    """``V = L^-1 K`` for some targets, with their mean ``V^T z`` and ``colsum(V^2)``."""

    def __init__(self, targets: int = 0) -> None:
        """Begin without rows, for ``targets`` columns of zeros."""
        self.count = targets
        self._width = targets
        self._rows = 0
        self._panels: list[FloatArray] = []
        self._mean = np.zeros(targets)
        self._reduction = np.zeros(targets)

    @property
    def mean(self) -> FloatArray:
        """``V^T z``, shape ``(q,)``; changes in place."""
        return self._mean[: self.count]

    @property
    def reduction(self) -> FloatArray:
        """``colsum(V^2)``, shape ``(q,)``; changes in place."""
        return self._reduction[: self.count]

    @property
    def memory_bytes(self) -> int:
        """What ``V`` takes, with room for rows and targets to come."""
        return sum(panel.nbytes for panel in self._panels)

    def append(self, growth: Growth, cross: FloatArray) -> None:
        """Follow the factor by the covariances of its new samples with the targets, ``(m, q)``."""
        remaining = cross
        if not self._width:
            self._store(np.empty((len(cross), 0)))
            return
        if self._width > self.count:
            remaining = np.zeros((len(cross), self._width))
            remaining[:, : self.count] = cross
        v = _whitened_rows(growth.L, self._less_known(remaining, growth.B))  # (m, width)
        self._store(v)
        self._mean += growth.z @ v
        self._reduction += np.einsum("mq,mq->q", v, v)

    def add(self, whitened: FloatArray, z: FloatArray) -> None:
        """Add targets.

        Args:
            whitened: ``L^-1`` times their covariances with all samples so far, shape ``(n, k)``.
            z: Whitened values of these samples, shape ``(n,)``.
        """
        k = whitened.shape[1]
        if self.count + k > self._width:
            self._widen(self.count + k + max(_SPARE_COLUMNS, self.count // 2))
        new = slice(self.count, self.count + k)
        for first, panel in self._filled():
            panel[:, new] = whitened[first : first + len(panel)]
        self._mean[new] = z @ whitened
        self._reduction[new] = np.einsum("nk,nk->k", whitened, whitened)
        self.count += k

    def replace_values(self, z: FloatArray) -> None:
        """Change the whitened values of all samples, shape ``(n,)``."""
        if not self._width:
            return
        self._mean[:] = 0.0
        for first, panel in self._filled():
            subtract_vector_product(self._mean, panel, -z[first : first + len(panel)])

    def scale(self, factor: float) -> None:
        """Multiply ``V`` by a number."""
        for _, panel in self._filled():  # the rest of its memory may hold anything
            np.multiply(panel, factor, out=panel)
        self._mean *= factor
        self._reduction *= factor**2

    def _less_known(self, remaining: FloatArray, B: FloatArray) -> FloatArray:
        """Return ``remaining - B^T V``, in the memory of ``remaining``."""
        if len(remaining) == 1:
            row, weights = remaining[0], B[:, 0]
            for first, panel in self._filled():
                subtract_vector_product(row, panel, weights[first : first + len(panel)])
            return row[None]
        for first, panel in self._filled():
            part = B[first : first + len(panel)]
            subtract_product(remaining.T, panel, part.T, transposed=True, left_transposed=True)
        return remaining

    def _store(self, v: FloatArray) -> None:
        used = self._rows % _TARGET_ROWS
        if used == 0:
            self._panels.append(np.empty((_TARGET_ROWS, self._width), order="F"))
        self._panels[-1][used : used + len(v)] = v
        self._rows += len(v)

    def _filled(self) -> list[tuple[int, FloatArray]]:
        """Return the first row and the filled part of every panel."""
        rows = self._rows
        return [
            (first, panel[: min(rows - first, _TARGET_ROWS)])
            for first, panel in zip(range(0, rows, _TARGET_ROWS), self._panels, strict=True)
        ]

    def _widen(self, width: int) -> None:
        for i, panel in enumerate(self._panels):
            wider = np.zeros((_TARGET_ROWS, width), order="F")
            wider[:, : self.count] = panel[:, : self.count]
            self._panels[i] = wider
        self._mean = np.concatenate([self.mean, np.zeros(width - self.count)])
        self._reduction = np.concatenate([self.reduction, np.zeros(width - self.count)])
        self._width = width


def _subtract_product(rest: FloatArray, left: FloatArray, right: FloatArray) -> None:
    """Take ``left right`` from ``rest``, for ``(r, n)`` and ``(n, k)``, all in C order."""
    if right.shape[1] == 1:
        rest[:, 0] -= _gemv(1.0, left.T, right[:, 0], trans=1)
    else:
        subtract_product(rest.T, right.T, left.T)


def _whitened_rows(L: FloatArray, rows: FloatArray) -> FloatArray:
    """Return ``L^-1 rows`` for rows ``(m, q)`` in C order, in their memory."""
    if len(L) == 1:
        rows /= L[0, 0]
    else:
        solve_in_place(L, rows.T, transposed=True, from_right=True)
    return rows
