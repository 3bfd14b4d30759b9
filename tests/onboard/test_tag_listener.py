"""Tags that a receiver on board hears, from its serial line to what the robot tells."""

import asyncio
import itertools
import random
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

from onboard.node.client import NodeClient
from onboard.node.tag_receiver import TagReceiverNode
from onboard.tag_listener import TagListener
from robot_link.clock import ScaledClock
from robot_link.messages import RobotId
from robot_link.tag.receiver_line import HeardLine, StatusLine, read_line, written_line
from simulator.background import alongside
from simulator.tag import LAKE_TAGS
from simulator.tag_receiver import TagReceiver
from tests.robot_link.rig import until

SERIAL = 480123
NOW = datetime(2026, 7, 1, 9, 30, 17, tzinfo=UTC)
PLACE = (260.0, 150.0, 3.0)
ALWAYS = replace(
    LAKE_TAGS[0], hearing=LAKE_TAGS[0].hearing.model_copy(update={"top": 1.0, "width_m": 1.0})
)


class Told:
    """Takes what a listener tells, in place of link and log."""

    def __init__(self):
        self.heard, self.reports, self.notes = [], [], []

    def record_detection(self, heard):
        self.heard.append(heard)
        return len(self.heard)

    def report_receiver(self, report):
        self.reports.append(report)

    def note(self, sentence):
        self.notes.append(sentence)

    @property
    def newest(self):
        return self.reports[-1]


@asynccontextmanager
async def listening(folder, **options):
    """A receiver on its line, its node, and a listener that stays at one place."""
    now = datetime.now(UTC)
    clock, told = ScaledClock(now, now, 1.0), Told()
    quiet = {"false_share": 0.0, "garbled_share": 0.0, **options}
    receiver = TagReceiver(SERIAL, lambda: PLACE, (), random.Random(1), clock, **quiet)
    node = TagReceiverNode(folder / "line")
    program = SimpleNamespace(
        estimate=SimpleNamespace(position_ned=(1.0, 2.0, 3.0), position_std_m=4.0)
    )
    async with receiver.pty(folder / "line"), node.server.serve() as address:
        client = NodeClient(address)
        listener = TagListener(RobotId("grace-1"), program, client, told, clock, told)
        async with (
            alongside(client.run(), "client"),
            alongside(listener.run(), "listener"),
        ):
            await client.connected()
            async with alongside(node.run(), "node"):
                while not (await client.ask("counts")).get("status"):
                    receiver.say(written_line(StatusLine(SERIAL, 0, clock.now(), {"DC": "0"})))
                    await asyncio.sleep(0.01)
                yield receiver, told, clock


async def test_a_transmission_becomes_a_detection_where_the_robot_is(tmp_path):
    async with listening(tmp_path) as (receiver, told, clock):
        at = clock.now().replace(microsecond=0)
        receiver.hear(ALWAYS, at)
        await until(lambda: told.heard)
    heard = told.heard[0]
    assert (heard.tag, heard.receiver, heard.measured_at) == ("A69-1601-179", SERIAL, at)
    assert (heard.position_ned, heard.position_std_m) == ((1.0, 2.0, 3.0), 4.0)
    assert told.newest.heard == 1


async def test_lines_that_are_not_believed_are_counted_and_kept_as_they_came(tmp_path):
    body = b"480123,001,2026-02-30 00:00:00,A69-1601,179"
    lines = [
        b"480123,001,2026-07-01 09:30:17,A69-1601,179,#00\r\n",
        body + b",#%02X\r\n" % (sum(body) & 0xFF),
        written_line(HeardLine(SERIAL, 2, NOW, "A69-1601-1", None)).replace(b"A69", b"B96"),
        b"x" * 500,
    ]
    unknown = b"480123,001,2026-07-01 09:30:17,FISH"
    lines.insert(2, unknown + b",#%02X\r\n" % (sum(unknown) & 0xFF))
    async with listening(tmp_path) as (receiver, told, _):
        for line in lines:
            receiver.say(line)
        await until(lambda: told.reports and told.newest.refused_sum == 3)
    newest = told.newest
    assert (newest.refused_date, newest.refused_code, newest.heard) == (1, 1, 0)
    assert "tag receiver: wrong date: 480123,001,2026-02-30" in " ".join(told.notes)


async def test_a_receiver_whose_clock_is_wrong_is_dated_by_the_robots(tmp_path):
    async with listening(tmp_path) as (receiver, told, clock):
        receiver.clock_offset = timedelta(seconds=-90)
        before = clock.now()
        receiver.hear(ALWAYS, before)
        await until(lambda: told.heard)
        receiver.clock_offset = timedelta()
        receiver.hear(ALWAYS, clock.now())
        await until(lambda: len(told.heard) == 2)
    assert abs(told.heard[0].measured_at - before) < timedelta(seconds=30)
    assert told.reports[0].clock_offset_s < -60.0
    off, right = (note for note in told.notes if "clock" in note)
    assert "the robot's is used" in off
    assert "right again" in right


def test_what_is_far_is_heard_seldom():
    now = NOW
    place = [PLACE]
    heard = []
    receiver = TagReceiver(
        SERIAL,
        lambda: place[0],
        (),
        random.Random(2),
        ScaledClock(now, now, 1.0),
        garbled_share=0.0,
    )
    receiver.say = heard.append
    shares = {}
    for distance_m in (0.0, 300.0, 600.0):
        place[0] = (PLACE[0] + distance_m, PLACE[1], 6.0)
        heard.clear()
        for _ in range(400):
            receiver.hear(LAKE_TAGS[0], now)
        shares[distance_m] = len(heard) / 400
    assert shares[0.0] > 0.85
    assert 0.37 < shares[300.0] < 0.53
    assert shares[600.0] < 0.05


async def test_tags_transmit_after_their_delays(tmp_path):
    now = datetime.now(UTC)
    clock = ScaledClock(now, now, 500.0)
    receiver = TagReceiver(SERIAL, lambda: PLACE, (ALWAYS,), random.Random(3), clock)
    said = []
    receiver.say = said.append
    async with receiver.pty(tmp_path / "line"):
        await until(lambda: len(said) >= 8)
    times = [read_line(line).at for line in said if b"A69" in line]
    gaps = [(after - before).total_seconds() for before, after in itertools.pairwise(times)]
    assert all(59.0 <= gap <= 181.0 for gap in gaps)
