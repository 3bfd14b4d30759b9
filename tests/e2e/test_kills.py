"""Each process of a station is killed while it works: nothing that it acknowledged is lost."""

import random

import pytest

from benchmarks.station.kills import DATABASE, run
from tests.postgresql_server import program

pytestmark = [pytest.mark.walk, pytest.mark.timeout(2400)]


@pytest.mark.parametrize(
    "on_postgresql",
    [
        False,
        pytest.param(
            True,
            marks=pytest.mark.skipif(
                program("postgres") is None, reason="there is no PostgreSQL on this machine"
            ),
        ),
    ],
    ids=["sqlite", "postgresql"],
)
def test_what_was_acknowledged_outlives_every_process_and_plans_are_taken_up_again(on_postgresql):
    drawn = random.Random()
    others = ["simulate", DATABASE if on_postgresql else "serve"]
    drawn.shuffle(others)
    # the station first: the plan in the making has only just begun
    found = run(["serve", *others], drawn, on_postgresql=on_postgresql, rest_s=(0.0, 0.0))
    assert (found.losses.samples_lost, found.losses.entries_lost) == ([], [])
    assert (found.losses.messages_lost, found.losses.doubles) == ([], 0)
    assert found.losses.samples
    assert found.losses.entries
    assert found.met >= 1, "no plan was taken up again"
    assert found.unmade == []
