"""The Micro-Modem's driver: ranges good and bad, a modem that restarts, and one that goes away."""

import asyncio
from contextlib import asynccontextmanager
from dataclasses import replace
from random import Random

import pytest

from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.micromodem import MicroModem
from robot_link.acoustic.modem_line import ModemRefusedError, ModemTiming
from robot_link.acoustic.nmea import decode, encode
from robot_link.clock import ScaledClock, SystemClock
from robot_link.messages import RobotId
from robot_link.transport.datagram import Garbled, PortChanged, PortClosedError

GRACE, MINI = RobotId("grace-1"), RobotId("mini-1")
HASTE = ModemTiming(echo_s=0.15, tries=3, check_s=30.0, reopen_s=0.01)
"""For what is never said, or only the second time."""
SOON_SILENT = replace(HASTE, echo_s=20.0)
"""For what is echoed, however late, and never answered."""
PATIENT = replace(HASTE, echo_s=20.0, spare_s=60.0)
"""For what is said, however late."""
NEAR = AcousticConfig(range_max_m=1.0, turnaround_s=0.0)
"""Answers are waited for little more than a second."""


class FakeModem:
    """The far side of the port: echoes commands, and answers as the test lets it."""

    def __init__(self, answers=None):
        self.commands = []
        self.is_deaf = False
        self.answers = answers or {}
        self.settings = {}
        self._incoming = asyncio.Queue()

    async def open(self):
        return self

    async def read(self):
        return await self._incoming.get()

    async def write(self, data):
        fields = decode(data)
        self.commands.append(fields)
        if self.is_deaf:
            return
        answer = self.answers.get(fields[0])
        if answer is not None:
            self.say(*(answer(fields) if callable(answer) else answer))
            return
        self.say(self.echo(fields))

    def echo(self, fields):
        if fields[0] == "CCCFG":
            self.settings[fields[1]] = fields[2]
        if fields[0] == "CCCFQ":
            return ("CACFG", fields[1], self.settings.get(fields[1], "0"))
        return ("CA" + fields[0][2:], *fields[1:])

    def say(self, *sentences):
        if sentences:
            self.bring(b"".join(map(encode, sentences)))

    def bring(self, data):
        self._incoming.put_nowait(data)

    def close(self):
        pass

    def count(self, name):
        return sum(fields[0] == name for fields in self.commands)


def scaled_clock(speed):
    now = SystemClock().now()
    return ScaledClock(now, now, speed)


@asynccontextmanager
async def driving(fake, config=NEAR, timing=PATIENT, on_mini=lambda _: None):
    modem = MicroModem(
        fake.open, 1, {2: GRACE, 3: MINI}, scaled_clock(20.0), config, timing, on_mini
    )
    running = asyncio.create_task(modem.run())
    events = modem.events()
    try:
        assert await anext(events) == PortChanged(is_open=True, reason="")
        yield modem, events
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


async def met(condition):
    async with asyncio.timeout(60):
        while True:
            if condition():
                return
            await asyncio.sleep(0.002)


async def answered(modem, peer=2):
    """Ping until an answer is in time: a busy machine may be late with one."""
    for _ in range(20):
        if (found := await modem.ping(peer)).is_valid:
            return found
    raise AssertionError(found.reason)


def replying(*pair, travel="0.0004"):
    return lambda fields: (("CAMPC", *fields[1:]), ("CAMPR", *pair, travel))


async def test_the_modem_is_told_its_address_and_what_to_report():
    fake = FakeModem()
    async with driving(fake) as (modem, _):
        assert modem.is_ready
        await met(lambda: fake.count("CCCLK"))
    assert fake.commands[:4] == [
        ("CCCFG", "SRC", "1"),
        ("CCCFG", "REV", "1"),
        ("CCCFG", "RXP", "1"),
        ("CCCFG", "CST", "1"),
    ]


@pytest.mark.parametrize("pair", [("1", "2"), ("2", "1")])
async def test_an_answer_is_a_range_whichever_modem_it_names_first(pair):
    fake = FakeModem({"CCMPC": replying(*pair)})
    async with driving(fake) as (modem, _):
        found = await modem.ping(2)
    assert (found.robot, found.peer, found.is_valid, found.reason) == (GRACE, 2, True, "")
    assert found.travel_time_s == 0.0004
    assert found.range_m == pytest.approx(0.6)


async def test_the_range_follows_the_speed_of_sound():
    fake = FakeModem({"CCMPC": replying("1", "2")})
    async with driving(fake) as (modem, _):
        modem.config = AcousticConfig(sound_speed_m_s=1400.0, range_max_m=1.0)
        assert (await modem.ping(2)).range_m == pytest.approx(0.56)


@asynccontextmanager
async def one_given_up(quiet_s: float, config=NEAR):
    """A modem that gave a ping up, and then answers as the test lets it."""
    fake = FakeModem()
    timing = replace(SOON_SILENT, quiet_s=quiet_s, spare_s=0.05)
    async with driving(fake, config, timing) as (modem, _):
        assert (await modem.ping(2)).range_m is None
        modem._timing = replace(timing, spare_s=60.0)
        yield fake, modem


async def test_answer_that_was_given_up_is_not_taken_for_that_of_the_next_ping():
    async with one_given_up(quiet_s=60.0) as (fake, modem):
        ping = asyncio.create_task(modem.ping(2))
        await asyncio.sleep(0.05)
        assert fake.count("CCMPC") == 1, "the next one waits"
        fake.say(("CAMPR", "1", "2", "0.0009"))
        await met(lambda: fake.count("CCMPC") == 2)
        fake.say(("CAMPR", "1", "2", "0.0004"))
        assert (await ping).travel_time_s == 0.0004
        assert modem.answers_late == 1


async def test_answer_from_farther_than_sound_came_since_the_ping_is_not_its_own():
    async with one_given_up(0.0, AcousticConfig(range_max_m=20000.0)) as (fake, modem):
        ping = asyncio.create_task(modem.ping(2))
        await met(lambda: fake.count("CCMPC") == 2)
        fake.say(("CAMPR", "1", "2", "900.0000"))
        await met(lambda: modem.answers_late == 1)
        fake.say(("CAMPR", "1", "2", "0.0100"))
        assert (await ping).travel_time_s == 0.01


async def test_ping_that_nobody_answers_holds_up_the_next_one_for_the_quiet_time_only():
    async with one_given_up(quiet_s=0.05) as (fake, modem):
        ping = asyncio.create_task(modem.ping(2))
        await met(lambda: fake.count("CCMPC") == 2)
        fake.say(("CAMPR", "1", "2", "0.0004"))
        assert (await ping).is_valid


@pytest.mark.parametrize("travel", ["0.0000", "-0.0100", "99.0"])
async def test_a_travel_time_that_cannot_be_is_told_and_not_valid(travel):
    fake = FakeModem({"CCMPC": replying("1", "2", travel=travel)})
    async with driving(fake) as (modem, _):
        found = await modem.ping(2)
    assert (found.is_valid, found.travel_time_s) == (False, float(travel))
    assert "cannot be" in found.reason


async def test_silence_and_garbled_answers_end_with_the_time_out():
    garbled = {"CCMPC": lambda fields: (("CAMPC", *fields[1:]), ("CAMSG", "BAD_CRC", "2"))}
    for answers, reason in ((None, "no answer"), (garbled, "only a garbled answer")):
        async with driving(FakeModem(answers), timing=SOON_SILENT) as (modem, _):
            found = await modem.ping(2)
        assert (found.is_valid, found.travel_time_s, found.range_m) == (False, None, None)
        assert found.reason == f"{reason} within 1.0 s"


async def test_answers_of_others_are_not_taken_for_ours():
    async with driving(fake := FakeModem()) as (modem, _):
        asking = asyncio.create_task(modem.ping(2))
        await met(lambda: fake.count("CCMPC"))
        fake.say(("CAMPR", "1", "3", "0.0001"), ("CAMPR", "2", "4", "0.0001"))
        fake.say(("CAMPR", "2", "1", "0.0005"))
        assert (await asking).travel_time_s == 0.0005


async def test_one_ping_is_in_the_water_at_a_time():
    async with driving(fake := FakeModem()) as (modem, _):
        asking = [asyncio.create_task(modem.ping(peer)) for peer in (2, 3)]
        await met(lambda: fake.count("CCMPC"))
        fake.say(("CAMPR", "1", "3", "0.0003"))  # nobody has asked it yet
        fake.say(("CAMPR", "1", "2", "0.0002"))
        await met(lambda: fake.count("CCMPC") == 2)
        fake.say(("CAMPR", "1", "3", "0.0004"))
        found = await asyncio.gather(*asking)
    assert [one.travel_time_s for one in found] == [0.0002, 0.0004]


async def test_a_late_answer_is_not_taken_for_the_next_ones():
    async with driving(fake := FakeModem(), timing=SOON_SILENT) as (modem, _):
        assert not (await modem.ping(2)).is_valid
        fake.say(("CAMPR", "1", "2", "0.0005"))
        fake.answers = {"CCMPC": replying("1", "3", travel="0.0001")}
        assert (await answered(modem, 3)).travel_time_s == 0.0001


async def test_a_modem_that_restarts_is_configured_again():
    async with driving(fake := FakeModem()) as (modem, _):
        await met(lambda: fake.count("CCCLK"))
        asking = asyncio.create_task(modem.ping(2))
        await met(lambda: fake.count("CCMPC"))
        fake.say(("CAREV", "101112", "INIT", "0.93.0.30"))
        found = await asking
        assert (found.is_valid, found.reason) == (False, "the modem restarted")
        await met(lambda: fake.commands.count(("CCCFG", "SRC", "1")) == 2)
        await met(lambda: modem.is_ready)
        fake.answers = {"CCMPC": replying("1", "2")}
        assert (await modem.ping(2)).is_valid


async def test_a_restart_that_was_not_heard_is_noticed_by_asking():
    timing = ModemTiming(echo_s=20.0, check_s=0.02, reopen_s=0.01)
    async with driving(fake := FakeModem(), timing=timing) as (_, _):
        await met(lambda: fake.count("CCCFQ"))
        fake.settings.clear()
        await met(lambda: fake.commands.count(("CCCFG", "SRC", "1")) >= 2)


async def test_a_command_that_is_not_echoed_is_sent_again():
    heard = []

    def second_time(fields):
        heard.append(fields)
        if len(heard) < 3:
            return ()
        return ("CAMPC", *fields[1:]), ("CAMPR", "1", "2", "0.0004")

    timing = replace(HASTE, tries=1000)
    async with driving(FakeModem({"CCMPC": second_time}), timing=timing) as (modem, _):
        assert (await answered(modem)).is_valid
    assert len(heard) >= 3


async def test_a_modem_that_falls_silent_is_opened_anew():
    async with driving(fake := FakeModem(), timing=HASTE) as (modem, events):
        await met(lambda: fake.count("CCCLK"))
        fake.is_deaf = True
        assert (await modem.ping(2)).reason == "no Micro-Modem answers"
        assert await anext(events) == PortChanged(is_open=False, reason="no Micro-Modem answers")
        assert (await modem.ping(2)).reason == "the modem is not there"
        fake.is_deaf = False
        while not (await anext(events)).is_open:
            pass
        fake.answers = {"CCMPC": replying("1", "2")}
        assert (await answered(modem)).is_valid


async def test_a_port_that_closes_ends_the_ping_and_is_opened_again():
    async with driving(fake := FakeModem()) as (modem, events):
        asking = asyncio.create_task(modem.ping(2))
        await met(lambda: fake.count("CCMPC"))
        fake.bring(b"")
        assert (await asking).reason == "the modem's port closed"
        assert await anext(events) == PortChanged(is_open=False, reason="the modem hung up")
        assert (await anext(events)).is_open


async def test_a_pulled_plug_keeps_the_modem_quiet():
    async with driving(FakeModem({"CCMPC": replying("1", "2")})) as (modem, events):
        modem.set_enabled(False)
        assert not (await anext(events)).is_open
        assert not modem.is_enabled
        assert (await modem.ping(2)).reason == "the modem is not there"
        with pytest.raises(PortClosedError):
            await modem.mini(2, 5)
        modem.set_enabled(True)
        assert (await anext(events)).is_open
        assert (await modem.ping(2)).is_valid


async def test_what_the_modem_complains_of_is_the_reason():
    refuse = {
        "CCMPC": (("CAERR", "101112", "NMEA", "3", "bad field"),),
        "CCMUC": (("CAERR", "101112", "NMEA", "4", "unknown"),),
    }
    async with driving(fake := FakeModem(refuse)) as (modem, _):
        assert (await modem.ping(2)).reason == "the modem refused: NMEA 3 bad field"
        with pytest.raises(ModemRefusedError, match="unknown"):
            await modem.mini(2, 7)
        assert modem.is_ready
    assert fake.count("CCMPC") == 3


async def test_an_older_modem_that_refuses_a_report_or_the_clock_serves_nevertheless():
    refuse = (("CAERR", "101112", "NMEA", "4", "unknown command"),)
    answers = {"CCCLK": refuse, "CCMPC": replying("1", "2")}
    async with driving(fake := FakeModem(answers)) as (modem, _):
        await met(lambda: fake.count("CCCLK") == 3)
        assert (await modem.ping(2)).is_valid


async def test_rubbish_on_the_line_is_told_and_harms_nothing():
    random = Random(23)
    async with driving(fake := FakeModem({"CCMPC": replying("1", "2")})) as (modem, events):
        for _ in range(50):
            fake.bring(random.randbytes(200))
        fake.bring(b"\r\n$CAMPR,1,2,0.01*00\r\n")
        fake.say(("CAMPR", "1", "2", "soon"), ("SNTTA",), ("CAMUA", "2"), ("CAMPR",))
        assert (await modem.ping(2)).is_valid
        assert isinstance(await anext(events), Garbled)


async def test_mini_packets_go_out_and_come_in():
    came = []
    async with driving(fake := FakeModem(), on_mini=came.append) as (modem, _):
        await modem.mini(2, 0x1ABC)
        fake.say(("CAMUA", "3", "1", "0abc"), ("CAMUA", "9", "1", "0001"), ("CAMUA", "1", "1", "1"))
        await met(lambda: came)
        for wrong in ((2, 0x2000), (9, 1)):
            with pytest.raises(ValueError, match=r"mini packet|no robot"):
                await modem.mini(*wrong)
    assert ("CCMUC", "1", "2", "1ABC") in fake.commands
    assert [(one.robot, one.peer, one.word) for one in came] == [(MINI, 3, 0xABC)]


async def test_transponders_tell_their_times_and_the_silent_ones_are_none():
    times = ("SNTTA", "0.0002", "", "0.0004", "", "101112.00")
    answers = {
        "CCPDT": lambda fields: (("SNPDT", *fields[1:]), times),
        "CCPNT": lambda fields: (("SNPNT", *fields[1:]), times),
    }
    async with driving(fake := FakeModem(answers)) as (modem, _):
        remus = await modem.ping_remus(3)
        generic = await modem.ping_narrow_band(26000, 5, 5, (25000, 25500, 26500, 27000))
        fake.answers, modem._timing = {}, SOON_SILENT
        silent = await modem.ping_remus(3)
    for found in (remus, generic):
        assert found.travel_times_s == (0.0002, None, 0.0004, None)
        assert found.ranges_m == pytest.approx((0.3, None, 0.6, None))
        assert found.is_valid
    assert (silent.is_valid, silent.ranges_m) == (False, (None,) * 4)
    assert "no answer" in silent.reason


async def test_a_robot_without_a_modem_cannot_be_asked():
    async with driving(FakeModem()) as (modem, _):
        with pytest.raises(ValueError, match="no robot"):
            await modem.ping(9)
