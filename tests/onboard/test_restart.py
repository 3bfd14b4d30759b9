"""A robot that is switched off at any moment: no word by satellite is lost or doubled."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from itertools import count
from pathlib import Path

import pytest

from onboard.computer import KEY_FILE, Computer
from onboard.node.client import NodeClient
from onboard.node.wire import NodeAddress
from robot_link.clock import SystemClock
from robot_link.messages import CommandKind, CommandNumber, OnboardPlanState
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import cut
from robot_link.satellite.content import TransferState
from robot_link.satellite.order import pack_order
from robot_link.transport.opening import open_transport
from simulator.aboard import computer_of
from simulator.fleet import MINI_1
from simulator.robot import SimulatedRobot
from tests.simulator.flight import EPOCH, mission, two_dives

KEY = bytes(range(32))
PLAN = mission(*two_dives())


class SwitchedOff(BaseException):
    """The robot's computer stops here."""


@contextmanager
def switched_off_at(monkeypatch, number: int, *, is_done: bool):
    """Stop at the file that is replaced as this one; ``is_done`` stops just after it."""
    replaced, replace_file = count(), Path.replace

    def replace_or_stop(self, target):
        stops = next(replaced) == number
        if stops and not is_done:
            raise SwitchedOff
        made = replace_file(self, target)
        if stops:
            raise SwitchedOff
        return made

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", replace_or_stop)
        yield


@contextmanager
def switched_on(memory: Path) -> Iterator[Computer]:
    """A robot's computer with what its memory holds; it floats, and nothing runs."""
    memory.mkdir(exist_ok=True)
    (memory / KEY_FILE).write_text(KEY.hex())
    robot = SimulatedRobot(MINI_1, 0, EPOCH)
    computer = computer_of(
        MINI_1,
        robot.program,
        radio=open_transport("udp://127.0.0.1:9"),
        clock=SystemClock(),
        memory=memory,
        satellite=NodeClient(NodeAddress(port=9)),
    )
    try:
        computer.talk._resume()
        yield computer
    finally:
        computer.log.close()


def hear(computer: Computer, messages) -> None:
    for message in messages:
        computer.talk._take(message)
        computer.step()


def said(computer: Computer) -> list[TransferState]:
    return [ack.state for ack in computer.talk._receiver.acks()]


def starts(memory: Path) -> int:
    logs = (memory / "log").glob("events-*")
    return sum(log.read_text().count("plan running") for log in logs)


@pytest.mark.parametrize("is_done", [False, True])
def test_plan_by_satellite_comes_on_board_once_wherever_the_robot_is_cut(
    tmp_path, monkeypatch, is_done
):
    messages = cut(Blob.of(PLAN), KEY, MINI_1.system_id, 5, start=True, ack_seen=False)
    for number in count():
        memory = tmp_path / str(number)
        try:
            with (
                switched_off_at(monkeypatch, number, is_done=is_done),
                switched_on(memory) as computer,
            ):
                hear(computer, messages)
        except SwitchedOff:
            pass
        else:
            break
        with switched_on(memory) as computer:
            hear(computer, (*messages, *messages))
            assert computer.link.plan_hash == PLAN.sha256()
            assert said(computer) == [TransferState.APPLIED]
        assert starts(memory) <= 1
        with switched_on(memory) as computer:
            hear(computer, messages)
            assert computer.link.plan_hash == PLAN.sha256()
            assert said(computer) == [TransferState.APPLIED]
            assert computer.program.executive.plan_state is OnboardPlanState.ON_BOARD, "it waits"
    assert number >= 4, "plan, parts, words and marks are each a file that is replaced"


@pytest.mark.parametrize("is_done", [False, True])
def test_surface_by_satellite_is_answered_wherever_the_robot_is_cut(tmp_path, monkeypatch, is_done):
    system = MINI_1.system_id
    chunks = cut(Blob.of(PLAN), KEY, system, 5, start=True, ack_seen=False)
    expires = EPOCH + timedelta(days=10_000)
    order = pack_order(CommandKind.SURFACE, CommandNumber(9), expires, None, KEY, system, 6)
    for number in count():
        memory = tmp_path / str(number)
        with switched_on(memory) as computer:
            hear(computer, chunks)
        try:
            with (
                switched_off_at(monkeypatch, number, is_done=is_done),
                switched_on(memory) as computer,
            ):
                hear(computer, [order])
        except SwitchedOff:
            pass
        else:
            break
        with switched_on(memory) as computer:
            hear(computer, [order, *chunks, order])
            answers = computer.talk._receiver.answers()
            assert [(one.number, one.outcome) for one in answers] == [(9, "done")]
            assert computer.program.executive.plan_state is not OnboardPlanState.RUNNING
    assert number >= 2


def test_robot_that_was_told_not_to_ping_does_not_ping_after_it_was_switched_off(tmp_path):
    for kind in (CommandKind.QUIET, CommandKind.PING):
        with switched_on(tmp_path) as computer:
            assert computer.program.obey(kind, "") is CommandOutcome.DONE
        for _ in range(2):
            with switched_on(tmp_path) as computer:
                is_quiet = computer.program.executive.tracking.is_quiet
                assert is_quiet == (kind is CommandKind.QUIET)
