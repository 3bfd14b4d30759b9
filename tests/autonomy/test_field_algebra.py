"""Routines called by their addresses do what numpy does, and let other threads run."""

import sys
import threading
import time

import numpy as np
import pytest

from autonomy.field.model.algebra import (
    factorize_in_place,
    solve_in_place,
    subtract_product,
    subtract_vector_product,
)
from autonomy.field.model.factorization import cholesky, solve_lower, solve_lower_transposed

RNG = np.random.default_rng(11)


def covariance_matrix(n: int) -> np.ndarray:
    root = RNG.standard_normal((n, n))
    return root @ root.T + n * np.eye(n)


@pytest.mark.parametrize("n", [0, 1, 2, 37])
def test_a_factor_times_its_transpose_is_the_matrix(n: int) -> None:
    matrix = covariance_matrix(n)
    factor = cholesky(matrix, 1.0)
    np.testing.assert_allclose(factor @ factor.T, matrix, rtol=1e-12, atol=1e-12)
    assert np.array_equal(factor, np.tril(factor))
    right = RNG.standard_normal((n, 3))
    np.testing.assert_allclose(factor @ solve_lower(factor, right), right, atol=1e-12)
    np.testing.assert_allclose(
        factor.T @ solve_lower_transposed(factor, right[:, 0]), right[:, 0], atol=1e-12
    )


def test_a_matrix_that_is_no_covariance_has_no_factor() -> None:
    assert not factorize_in_place(np.asfortranarray([[1.0, 2.0], [2.0, 1.0]]))
    assert not factorize_in_place(np.asfortranarray([[np.nan]]))
    with pytest.raises(ValueError, match="not a covariance"):
        cholesky(np.array([[1.0, 0.0], [0.0, -1.0]]), 1.0)


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("from_right", [False, True])
def test_triangles_are_solved_with_from_both_sides_in_part_of_a_larger_array(
    transposed: bool, from_right: bool
) -> None:
    factor = cholesky(covariance_matrix(6), 1.0)
    whole = np.asfortranarray(RNG.standard_normal((9, 9)))
    part = whole[:4, :6] if from_right else whole[:6, :4]
    before, untouched = part.copy(), whole[7:].copy()
    solve_in_place(factor, part, transposed=transposed, from_right=from_right)
    triangle = factor.T if transposed else factor
    again = part @ triangle if from_right else triangle @ part
    np.testing.assert_allclose(again, before, atol=1e-12)
    assert np.array_equal(whole[7:], untouched)


def test_a_vector_product_is_taken_from_a_vector_in_part_of_a_larger_array() -> None:
    panel = np.asfortranarray(RNG.standard_normal((9, 5)))
    weights = RNG.standard_normal((4, 3))[:, 1]
    result = RNG.standard_normal((5, 2))
    expected = result[:, 0] - panel[:4].T @ weights
    untouched = result[:, 1].copy()
    subtract_vector_product(result[:, 0], panel[:4], weights)
    np.testing.assert_allclose(result[:, 0], expected, atol=1e-12)
    assert np.array_equal(result[:, 1], untouched)
    with pytest.raises(ValueError, match="Fortran order"):
        subtract_vector_product(result[:, 0], np.zeros((4, 5)), weights)
    with pytest.raises(ValueError, match="first entry first"):
        subtract_vector_product(result[::-1, 0], panel[:4], weights)


def test_products_with_the_transpose_of_the_left_matrix_are_taken_in_place() -> None:
    left, right = (np.asfortranarray(RNG.standard_normal(shape)) for shape in ((9, 5), (4, 3)))
    result = np.asfortranarray(RNG.standard_normal((5, 4)))
    expected = result - left[:3].T @ right.T
    subtract_product(result, left[:3], right, transposed=True, left_transposed=True)
    np.testing.assert_allclose(result, expected, atol=1e-12)


def test_products_are_taken_from_a_matrix_in_its_place() -> None:
    left, right = (np.asfortranarray(RNG.standard_normal(shape)) for shape in ((5, 3), (3, 4)))
    result = np.asfortranarray(RNG.standard_normal((5, 4)))
    expected = result - left @ right
    subtract_product(result, left, right)
    np.testing.assert_allclose(result, expected, atol=1e-12)
    subtract_product(result, left, np.asfortranarray(right.T), transposed=True)
    np.testing.assert_allclose(result, expected - left @ right, atol=1e-12)


def test_a_matrix_that_lies_otherwise_in_memory_is_refused() -> None:
    with pytest.raises(ValueError, match="Fortran order"):
        factorize_in_place(np.ones((3, 4))[:, :3])
    with pytest.raises(ValueError, match="Fortran order"):
        factorize_in_place(np.eye(3, dtype=np.float32))


def test_other_threads_run_while_a_routine_does() -> None:
    # Until the interval is over no thread is made to give way: others run only where one lets them.
    interval_s = sys.getswitchinterval()
    matrix, steps, seen = np.asfortranarray(covariance_matrix(600)), [0], [False]

    def work() -> None:
        for _ in range(10_000):
            copy, before = matrix.copy(order="F"), steps[0]
            factorize_in_place(copy)
            if steps[0] > before:
                seen[0] = True
                return

    sys.setswitchinterval(1000.0)
    try:
        thread = threading.Thread(target=work)
        thread.start()
        while thread.is_alive():
            steps[0] += 1
            time.sleep(0.0002)
        thread.join()
    finally:
        sys.setswitchinterval(interval_s)
    assert seen[0]
