"""Parameters between a robot and those who read and set them."""

import struct
from collections.abc import Iterable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.link.parameter_server import ParameterServer
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.parameter_table import (
    Parameter,
    ParameterRefusal,
    ParameterTable,
    ParameterType,
)
from robot_link.service.parameter_wire import IntegerEncoding, from_wire, guessed_encoding, to_wire
from robot_link.station.error import NoAnswerError, ServiceRefusedError
from robot_link.station.parameter_client import ParameterClient
from tests.robot_link.service_pair import HASTY, ROBOT, Wire

REAL, WHOLE = ParameterType.REAL32, ParameterType.INT32
DECLARED = (
    Parameter("GAIN_PITCH", REAL, 0.4, 0.0, 2.0),
    Parameter("CONTROLLER", ParameterType.UINT8, 1, 0, 5),
    Parameter("OFFSET", WHOLE, -3, -1000, 1000),
    *(Parameter(f"SPARE_{n}", WHOLE, n, -(2**31), 2**31 - 1) for n in range(20)),
)


def pair(
    table: ParameterTable, may_write: str = "", **conditions: float
) -> tuple[ParameterClient, Wire]:
    server = ParameterServer(table, lambda: may_write)

    def answer(message: WireMessage) -> list[WireMessage]:
        return [*server.hear(message), *server.owed()]

    wire = Wire(answer, **conditions)
    client = ParameterClient(wire, patience=HASTY)
    wire.client = client.hear
    return client, wire


async def test_every_parameter_is_read_though_a_third_of_the_frames_is_lost():
    table = ParameterTable(DECLARED)
    client, wire = pair(table, loss=0.33, duplication=0.2)
    hear, robot = wire.client, wire.robot

    def asked(message: WireMessage) -> Iterable[WireMessage]:
        if isinstance(message, grace.MAVLink_param_request_list_message):
            client._exchange.patience = replace(HASTY, answer_s=60.0)
        return robot(message)

    def heard(message: WireMessage) -> None:
        """The list has begun to come, however late: now what lacks is soon asked for."""
        client._exchange.patience = HASTY
        hear(message)

    wire.robot, wire.client = asked, heard
    assert await client.read_all() == table.all()
    lists = [m for m in wire.asked if isinstance(m, grace.MAVLink_param_request_list_message)]
    single = [m for m in wire.asked if isinstance(m, grace.MAVLink_param_request_read_message)]
    assert len(lists) == 1
    assert len(single) >= 1


@pytest.mark.parametrize(("name", "value"), [("GAIN_PITCH", 1.1), ("OFFSET", -77), ("SPARE_0", 4)])
async def test_a_written_value_is_on_board_and_read_back(name: str, value: float):
    told: list[tuple[str, float]] = []
    table = ParameterTable(DECLARED, on_change=lambda *change: told.append(change))
    client, _ = pair(table, loss=0.2)
    written = await client.write(name, value)
    assert written == table.read(name)
    assert written.value == pytest.approx(value, rel=1e-7)
    assert told == [(name, written.value)]


async def test_a_value_beyond_its_limit_is_refused_and_changes_nothing():
    table = ParameterTable(DECLARED)
    client, _ = pair(table)
    with pytest.raises(ServiceRefusedError, match="outside the robot's limits"):
        await client.write("GAIN_PITCH", 2.5)
    with pytest.raises(ValueError, match=r"0\.5 is no value of type INT32"):
        await client.write("OFFSET", 0.5)
    with pytest.raises(ServiceRefusedError, match="no parameter of this name"):
        await client.read("NONE_SUCH")
    assert table.all() == ParameterTable(DECLARED).all()


async def test_who_may_not_write_is_told_so_and_reads_on():
    table = ParameterTable(DECLARED)
    client, _ = pair(table, may_write="another ground station holds this robot")
    with pytest.raises(ServiceRefusedError, match="does not let this parameter be set now"):
        await client.write("OFFSET", 1)
    assert (await client.read("OFFSET")).value == -3


async def test_a_vehicle_that_echoes_but_keeps_its_value_is_found_out():
    table = ParameterTable(DECLARED)
    server = ParameterServer(table)

    def liar(message: WireMessage) -> list[WireMessage]:
        if isinstance(message, grace.MAVLink_param_set_message):
            return ParameterServer(ParameterTable(DECLARED)).hear(message)
        return server.hear(message)

    wire = Wire(liar)
    client = ParameterClient(wire, patience=HASTY)
    wire.client = client.hear
    with pytest.raises(ServiceRefusedError, match=r"still holds 0\.4"):
        await client.write("GAIN_PITCH", 0.5)


async def test_a_silent_robot_ends_the_reading_with_a_sentence():
    client, wire = pair(ParameterTable(DECLARED))
    wire.is_cut = True
    with pytest.raises(NoAnswerError, match="the robot did not answer"):
        await client.read_all()


async def test_a_vehicle_that_casts_says_so_by_its_capability_and_is_understood():
    casts = IntegerEncoding.C_CAST

    def vehicle(message: WireMessage) -> list[WireMessage]:
        match message:
            case grace.MAVLink_command_long_message():
                return [version(grace.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST)]
            case grace.MAVLink_param_request_list_message():
                carried = to_wire(1067030938, REAL, casts)
                return [grace.MAVLink_param_value_message(b"BIG", carried, WHOLE, 1, 0)]
            case _:
                return []

    wire = Wire(vehicle)
    client = ParameterClient(wire, patience=HASTY)
    wire.client = client.hear
    (value,) = await client.read_all()
    assert value.value == struct.unpack("<f", struct.pack("<f", 1067030938))[0]


def version(capabilities: int) -> WireMessage:
    return grace.MAVLink_autopilot_version_message(
        capabilities, 0, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, ROBOT
    )


@given(st.sampled_from(ParameterType), st.data())
def test_a_value_is_the_same_after_its_way_over_the_wire(kind: ParameterType, data: st.DataObject):
    low, high = kind.limits
    values = st.integers(int(low), int(high)) if kind.is_integer else st.floats(width=32)
    value = data.draw(values.filter(lambda drawn: drawn == drawn and abs(drawn) <= high + 1))
    if not kind.survives_bytewise(value):
        with pytest.raises(ValueError, match="cannot be carried exactly"):
            to_wire(value, kind, IntegerEncoding.BYTEWISE)
        return
    carried = to_wire(value, kind, IntegerEncoding.BYTEWISE)
    message = grace.MAVLink_param_value_message(b"X", carried, int(kind), 1, 0)
    again = Wire(lambda _: []).over_the_wire(message)
    assert from_wire(again, IntegerEncoding.BYTEWISE) == value
    if kind.is_integer and abs(value) <= 2**24:
        cast = grace.MAVLink_param_value_message(b"X", float(value), int(kind), 1, 0)
        assert from_wire(cast, IntegerEncoding.C_CAST) == value


def test_four_as_mavsdk_sends_it_is_four():
    message = grace.MAVLink_param_value_message(b"X", 5.605193857299268e-45, WHOLE, 1, 0)
    assert guessed_encoding((message,)) is IntegerEncoding.BYTEWISE
    assert from_wire(message, IntegerEncoding.BYTEWISE) == 4
    cast = grace.MAVLink_param_value_message(b"X", 4.0, WHOLE, 1, 0)
    assert guessed_encoding((message, cast)) is IntegerEncoding.BYTEWISE
    assert guessed_encoding((cast,)) is IntegerEncoding.C_CAST


async def test_a_robot_whose_memory_is_full_says_so_and_flies_on_with_the_old_value():
    applied: list[float] = []

    def full(_name: str, value: float) -> None:
        applied.append(value)
        raise OSError(28, "No space left on device")

    table = ParameterTable(DECLARED, on_change=full)
    client, _ = pair(table)
    with pytest.raises(ServiceRefusedError, match="does not let this parameter be set now"):
        await client.write("OFFSET", 5)
    assert (await client.read("OFFSET")).value == -3
    assert applied[-1] == -3


def test_a_table_keeps_only_what_fits():
    changed: list[object] = []
    table = ParameterTable(
        DECLARED,
        values={"OFFSET": 12, "GAIN_PITCH": 99.0, "GONE": 1},
        on_change=lambda *change: changed.append(change),
    )
    assert table.read("OFFSET").value == 12
    assert table.read("GAIN_PITCH").value == pytest.approx(0.4)
    for name, value, why in (
        ("OFFSET", 0.5, "whole number"),
        ("OFFSET", 1001, "between -1000 and 1000"),
        ("GAIN_PITCH", float("nan"), "finite"),
        ("SPARE_1", -5_000_000, "MAVLink cannot carry it"),
    ):
        with pytest.raises(ParameterRefusal, match=why):
            table.set(name, value)
    with pytest.raises(KeyError):
        table.set("GONE", 1)
    assert changed == []
    with pytest.raises(ValueError, match="declared twice"):
        ParameterTable((DECLARED[0], DECLARED[0]))
    with pytest.raises(ValueError, match="ASCII"):
        Parameter("A_NAME_THAT_IS_TOO_LONG", REAL, 0, 0, 1)
