import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from autonomy.arrays import evenly_spread


@given(count=st.integers(0, 500), most=st.integers(2, 60))
def test_a_few_rows_stand_for_all_from_the_first_to_the_last(count, most):
    chosen = evenly_spread(count, most)
    assert len(chosen) == min(count, most)
    if count > 1:
        assert (chosen[0], chosen[-1]) == (0, count - 1)
        even = (count - 1) // (len(chosen) - 1)
        assert set(np.diff(chosen).tolist()) <= {even, even + 1}


def test_one_row_for_many_is_the_first():
    assert evenly_spread(9, 1).tolist() == [0]
