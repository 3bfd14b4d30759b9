"""Routines of BLAS and LAPACK that let other threads run meanwhile.

scipy's own wrappers keep the interpreter's lock until a routine has ended: a map of 2,000 samples
that is made anew in a thread would stop the event loop beside it for most of a second. The same
routines called by their addresses, which scipy offers to compiled code, do not.

Matrices are in Fortran order: a matrix in C order is given as its transpose.
"""

import ctypes
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray

_BLAS, _LAPACK = "scipy.linalg.cython_blas", "scipy.linalg.cython_lapack"
_ITEM = np.dtype(np.float64).itemsize
_Integer = ctypes.POINTER(ctypes.c_int)
_Number = ctypes.POINTER(ctypes.c_double)
_Text = ctypes.c_char_p
_Array = ctypes.c_void_p
_name_of_capsule = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(
    ("PyCapsule_GetName", ctypes.pythonapi)
)
_address_in_capsule = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)


def _routine(library: str, name: str, *arguments: Any) -> Any:  # noqa: ANN401 - ctypes' own
    offered: Mapping[str, object] = vars(import_module(library))["__pyx_capi__"]
    capsule = offered[name]
    address = _address_in_capsule(capsule, _name_of_capsule(capsule))
    return ctypes.CFUNCTYPE(None, *arguments)(address)


_dpotrf = _routine(_LAPACK, "dpotrf", _Text, _Integer, _Array, _Integer, _Integer)
_dtrsm = _routine(
    _BLAS,
    "dtrsm",
    *(_Text, _Text, _Text, _Text, _Integer, _Integer, _Number),
    *(_Array, _Integer, _Array, _Integer),
)
_dgemm = _routine(
    _BLAS,
    "dgemm",
    *(_Text, _Text, _Integer, _Integer, _Integer, _Number),
    *(_Array, _Integer, _Array, _Integer, _Number, _Array, _Integer),
)
_dgemv = _routine(
    _BLAS,
    "dgemv",
    *(_Text, _Integer, _Integer, _Number, _Array, _Integer),
    *(_Array, _Integer, _Number, _Array, _Integer),
)


def factorize_in_place(matrix: FloatArray) -> bool:
    """Put the lower Cholesky factor in place of the lower triangle of a matrix ``(n, n)``.

    Returns:
        Whether there is one; without, the matrix holds nothing of use.
    """
    n, failed = len(matrix), ctypes.c_int()
    _dpotrf(b"L", _integer(n), *_columns(matrix), ctypes.byref(failed))
    # What is no number gives a factor that is none, without a word.
    return failed.value == 0 and bool(np.isfinite(np.diagonal(matrix)).all())


def solve_in_place(
    factor: FloatArray, right: FloatArray, *, transposed: bool = False, from_right: bool = False
) -> None:
    """Put ``L^-1 right``, or what the options say, in place of ``right``.

    Args:
        factor: Lower triangular ``L``; what is above its diagonal is not looked at.
        right: Shape ``(n, m)`` for ``L`` of shape ``(n, n)``, or ``(m, n)`` from the right.
        transposed: Take ``L^T`` for ``L``.
        from_right: Leave ``right L^-1``.
    """
    _dtrsm(
        b"R" if from_right else b"L",
        b"L",
        b"T" if transposed else b"N",
        b"N",
        _integer(right.shape[0]),
        _integer(right.shape[1]),
        _number(1.0),
        *_columns(factor),
        *_columns(right),
    )


def subtract_product(
    result: FloatArray,
    left: FloatArray,
    right: FloatArray,
    *,
    transposed: bool = False,
    left_transposed: bool = False,
) -> None:
    """Take the product of two matrices from a third, in its place.

    Args:
        result: Shape ``(n, m)``.
        left: Shape ``(n, k)``, or ``(k, n)`` of which the transpose is taken.
        right: Shape ``(k, m)``, or ``(m, k)`` of which the transpose is taken.
        transposed: Take the transpose of ``right``.
        left_transposed: Take the transpose of ``left``.
    """
    _dgemm(
        b"T" if left_transposed else b"N",
        b"T" if transposed else b"N",
        _integer(result.shape[0]),
        _integer(result.shape[1]),
        _integer(left.shape[0 if left_transposed else 1]),
        _number(-1.0),
        *_columns(left),
        *_columns(right),
        _number(1.0),
        *_columns(result),
    )


def subtract_vector_product(result: FloatArray, matrix: FloatArray, vector: FloatArray) -> None:
    """Take ``matrix^T vector`` from a vector, in its place.

    Args:
        result: Shape ``(n,)``.
        matrix: Shape ``(k, n)``.
        vector: Shape ``(k,)``.
    """
    _dgemv(
        b"T",
        _integer(matrix.shape[0]),
        _integer(matrix.shape[1]),
        _number(-1.0),
        *_columns(matrix),
        *_entries(vector),
        _number(1.0),
        *_entries(result),
    )


def _columns(matrix: FloatArray) -> tuple[int, object]:
    """Return where a matrix lies in memory, and how far apart its columns are."""
    rows, columns = matrix.shape
    step, stride = matrix.strides
    apart = stride // _ITEM if columns > 1 and rows else max(rows, 1)
    is_usable = not matrix.size or ((rows < 2 or step == _ITEM) and apart >= rows)
    if matrix.dtype != np.float64 or not is_usable:
        raise ValueError("a matrix for BLAS must hold float64 in Fortran order")
    return matrix.ctypes.data, _integer(apart)


def _entries(vector: FloatArray) -> tuple[int, object]:
    """Return where a vector lies in memory, and how far apart its entries are."""
    (step,) = vector.strides
    if vector.dtype != np.float64 or step % _ITEM or step <= 0:
        raise ValueError("a vector for BLAS must hold float64, first entry first")
    return vector.ctypes.data, _integer(step // _ITEM)


def _integer(value: int) -> object:
    return ctypes.byref(ctypes.c_int(value))


def _number(value: float) -> object:
    return ctypes.byref(ctypes.c_double(value))
