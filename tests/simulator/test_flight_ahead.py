"""The compiled flight against the onboard program and the simulated robot, with the same noise."""

import sys

import numpy as np
import pytest

from simulator.ahead.state import ROW_BATTERY, ROW_BELIEVED_NORTH, ROW_DOWN, ROW_NORTH, ROW_STD
from tests.simulator.ahead_flight import flown_pair, leg_length_m


@pytest.mark.timeout(900)  # the kernel may have to be compiled first
@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("water", ["tank", "lake"])
def test_the_kernel_flies_as_the_readable_program_does_leg_by_leg(water, number):
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    sys.stdout.write(f"\nflight {number} in the {water}: seed {seed}\n")
    pair = flown_pair(seed, water)
    truth, mine = pair.readable, pair.compiled
    assert mine.is_done == truth.is_done
    assert [tuple(change[1:]) for change in mine.changes.tolist()] == [
        change[1:] for change in truth.changes
    ]
    np.testing.assert_allclose(mine.changes[:, 0], [one[0] for one in truth.changes], atol=1e-6)
    assert len(mine.rows) == len(truth.rows)
    for first in (ROW_NORTH, ROW_BELIEVED_NORTH):
        off_m = np.linalg.norm((mine.rows - truth.rows)[:, first : first + 3], axis=1)
        for leg in np.unique(truth.rows[:, 1].astype(int)):
            length_m = leg_length_m(pair.mission, leg)
            allowed_m = 0.05 if water == "tank" else max(0.01 * length_m, 0.01)
            assert off_m[truth.rows[:, 1] == leg].max() < allowed_m
    np.testing.assert_allclose(mine.rows[:, ROW_STD], truth.rows[:, ROW_STD], rtol=1e-3)
    np.testing.assert_allclose(mine.rows[:, ROW_BATTERY], truth.rows[:, ROW_BATTERY], rtol=1e-6)
    assert mine.rows[:, ROW_DOWN].max() > 0.0
