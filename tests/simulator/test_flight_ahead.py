"""The compiled flight against the onboard program and the simulated robot, with the same noise."""

import sys

import numpy as np
import pytest

from simulator.ahead.state import ROW_BATTERY, ROW_BELIEVED_NORTH, ROW_DOWN, ROW_NORTH, ROW_STD
from tests.simulator.ahead_flight import STARTS, flown_pair, leg_length_m


@pytest.mark.timeout(900)  # the kernel may have to be compiled first
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("water", ["tank", "lake"])
def test_the_kernel_flies_as_the_readable_program_does_leg_by_leg(water, start):
    count = 0
    while count <= 300:  # a flight that is chaotic from its start on tells nothing
        seed = int(np.random.SeedSequence().generate_state(1)[0])
        sys.stdout.write(f"\nin the {water}, {start}: seed {seed}\n")
        pair = flown_pair(seed, water, start)
        count = pair.calm_rows
    until_s = pair.calm_until_s
    truth, mine = pair.readable.rows[:count], pair.compiled.rows[:count]
    sys.stdout.write(f"judged for {until_s:.0f} of {pair.readable.rows[-1, 0]:.0f} s\n")
    assert len(mine) == count
    changes = [change for change in pair.readable.changes if change[0] <= until_s]
    flown = pair.compiled.changes[: len(changes)].tolist()
    assert [tuple(change[1:]) for change in flown] == [change[1:] for change in changes]
    assert [change[0] for change in flown] == pytest.approx(
        [change[0] for change in changes], abs=1e-6
    )
    if pair.is_calm:
        assert pair.compiled.is_done == pair.readable.is_done
        assert len(pair.compiled.rows) == count
        assert len(pair.compiled.changes) == len(changes)
    for first in (ROW_NORTH, ROW_BELIEVED_NORTH):
        off_m = np.linalg.norm((mine - truth)[:, first : first + 3], axis=1)
        for leg in np.unique(truth[:, 1].astype(int)):
            length_m = leg_length_m(pair.mission, leg)
            allowed_m = 0.05 if water == "tank" else max(0.01 * length_m, 0.01)
            assert off_m[truth[:, 1] == leg].max() < allowed_m
    np.testing.assert_allclose(mine[:, ROW_STD], truth[:, ROW_STD], rtol=1e-3)
    np.testing.assert_allclose(mine[:, ROW_BATTERY], truth[:, ROW_BATTERY], rtol=1e-4)
    assert mine[:, ROW_DOWN].max() > 0.0
