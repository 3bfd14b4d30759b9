"""The table of a command's levels: every pair of level and proof, and who may raise one."""

from datetime import UTC, datetime, timedelta
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from db.query.mission.commands import CREATED, add_command, get_command
from db.query.station.events import newest_events
from robot_link.messages import CommandKind, CommandLevel
from server.command.state import SETTLED, TRANSITIONS, apply
from tests.server.conftest import GRACE
from tests.server.one_writer import callers_of

AT = datetime(2026, 5, 1, tzinfo=UTC)
RISING = (CREATED, "queued", "radio")
PROOFS = st.tuples(st.sampled_from(CommandLevel), st.sampled_from(["xbee", "rockblock"]))


@pytest.mark.parametrize(("level", "proof"), [*product(SETTLED, CommandLevel)])
def test_nothing_overrules_what_settled_a_command(level, proof):
    assert (level, proof) not in TRANSITIONS


@pytest.mark.parametrize(("level", "proof"), [*product(RISING, CommandLevel)])
def test_proof_raises_a_command_to_its_own_level_or_not_at_all(level, proof):
    step = TRANSITIONS.get((level, proof))
    if proof.value in SETTLED:
        assert step is not None, "an answer may be the first that is heard"
    if step is not None:
        assert (step.state, step.event) == (proof.value, f"command.{proof.value}")
        assert step.state in SETTLED or RISING.index(step.state) > RISING.index(level)


@given(story=st.lists(PROOFS, max_size=8))
def test_command_follows_the_table_and_nothing_else(memory, story):
    def live(session):
        later = AT + timedelta(days=1)
        command = add_command(
            session, GRACE, CommandKind.HOLD, at=AT, expires_at=later, by="test"
        ).id
        level, told = CREATED, []
        for proof, carrier in story:
            step = TRANSITIONS.get((level, proof))
            apply(session, command, proof, at=AT, carrier=carrier)
            if step is not None:
                level = step.state
                told.append(step.event)
            assert get_command(session, command).level == level
        events = newest_events(session, limit=20)
        assert told == [one.kind for one in events if one.data.get("command") == command]

    memory.change(live).result(60)


def test_one_module_raises_commands():
    assert callers_of("add_level") == {"command/state.py"}
