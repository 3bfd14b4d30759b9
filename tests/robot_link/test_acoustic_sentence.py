"""Sentences of the Micro-Modem: checksums, meanings, and streams full of rubbish."""

from contextlib import suppress
from datetime import UTC, datetime
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.acoustic import sentence
from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.nmea import SentenceReader, decode, encode
from robot_link.acoustic.sentence import (
    BeaconReply,
    MiniHeard,
    ModemError,
    ModemStarted,
    PacketGarbled,
    PingReply,
    meaning,
)


@pytest.mark.parametrize(
    ("line", "fields"),
    [
        (b"$CAMPA,1,2*5D", ("CAMPA", "1", "2")),
        (b"$CAMPR,2,1,0.0101*7C\r\n", ("CAMPR", "2", "1", "0.0101")),
    ],
)
def test_published_sentences_verify(line, fields):
    assert decode(line) == fields
    assert encode(fields) == line.rstrip() + b"\r\n"


def test_a_sentence_with_one_changed_bit_is_refused():
    line = b"$CAMPR,2,1,0.0101*7C"
    for at in range(1, len(line)):
        for bit in range(8):
            changed = bytearray(line)
            changed[at] ^= 1 << bit
            if changed.upper() == line:
                continue  # the checksum's own digit in small letters
            with pytest.raises(ValueError, match=r"checksum|dollar|character"):
                decode(bytes(changed))


@pytest.mark.parametrize("line", [b"", b"CAMPR,2,1", b"$CAMPR,2,1", b"$CAMPR,2,1*", b"$A*4"])
def test_a_sentence_without_dollar_or_checksum_is_none(line):
    with pytest.raises(ValueError, match=r"checksum|dollar"):
        decode(line)


fields = st.lists(
    st.text(st.characters(codec="ascii", categories=("L", "N", "P")), max_size=8).filter(
        lambda text: not set(text) & set("$*,")
    ),
    min_size=1,
    max_size=8,
)


@given(st.lists(fields, max_size=4), st.integers(1, 7), st.binary(max_size=20))
def test_sentences_are_found_in_a_stream_cut_anywhere(sentences, size, rubbish):
    stream = rubbish.replace(b"$", b"") + b"\r\n" + b"".join(map(encode, sentences))
    reader = SentenceReader()
    found = []
    for at in range(0, len(stream), size):
        found += reader.feed(stream[at : at + size])[0]
    assert found == [tuple(one) for one in sentences]


def test_rubbish_is_counted_and_takes_no_memory():
    reader, random = SentenceReader(), Random(7)
    bad = 0
    for _ in range(300):
        sentences, lines = reader.feed(random.randbytes(5000).replace(b"\r", b"x"))
        assert sentences == []
        bad += len(lines)
        assert len(reader._rest) <= 4096 + 5000
    assert bad > 300
    for _ in range(100):
        reader.feed(b"$" * 10_000)
        assert len(reader._rest) <= 4096
    assert reader.feed(b"\n" + encode(("CAREV", "1", "INIT")))[0] == [("CAREV", "1", "INIT")]


@pytest.mark.parametrize("field", ["a,b", "a*b", "$a", "é", "a\r"])
def test_a_field_that_would_split_a_sentence_is_refused(field):
    with pytest.raises(ValueError, match="field"):
        encode(("CCMPC", field))


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        (("CAMPR", "1", "2", "0.0101"), PingReply(frozenset((1, 2)), 0.0101)),
        (("CAMPR", "2", "1", "0.0101", "extra"), PingReply(frozenset((1, 2)), 0.0101)),
        (("SNTTA", "0.1", "", "0.3", "", "101112.00"), BeaconReply((0.1, None, 0.3, None))),
        (("CAMUA", "2", "1", "1FFF"), MiniHeard(2, 1, 0x1FFF)),
        (("CAREV", "101112", "INIT", "0.93.0.30"), ModemStarted()),
        (("CAREV", "101112", "AUV", "0.93.0.30"), None),
        (("CAMSG", "BAD_CRC", "2"), PacketGarbled()),
        (("CAERR", "101112", "NMEA", "3", "bad field"), ModemError("NMEA 3 bad field")),
        (("CAMPC", "1", "2"), None),
        (("CACST", "1", "2", "3"), None),
    ],
)
def test_each_sentence_means_what_the_manual_says(fields, what):
    assert meaning(fields) == what


@pytest.mark.parametrize(
    "fields",
    [
        ("CAMPR", "1", "2", "soon"),
        ("CAMPR", "1", "2", "nan"),
        ("CAMPR", "1", "2"),
        ("CAMPR", "-1", "2", "0.1"),
        ("CAMUA", "2", "1", "2000"),
        ("CAMUA", "2", "1", "xyz"),
        ("CAMUA", "2", "1"),
        ("SNTTA", "0.1"),
    ],
)
def test_a_sentence_that_breaks_its_promise_is_refused(fields):
    with pytest.raises(ValueError, match=r"\w+"):
        meaning(fields)


KNOWN = ("CAMPR", "SNTTA", "CAMUA", "CAREV", "CAMSG", "CAERR")


@given(fields)
def test_any_fields_mean_something_or_are_refused(fields):
    for name in (*KNOWN, *fields[:1]):
        with suppress(ValueError):
            assert meaning((name, *fields)) is None or name in KNOWN


def test_an_echo_repeats_its_command_but_for_zeros_and_the_modems_own_time():
    clock = sentence.clock(datetime(2026, 11, 21, 10, 2, 3, tzinfo=UTC))
    assert clock == ("CCCLK", "2026", "11", "21", "10", "2", "3")
    assert sentence.is_echo(clock, ("CACLK", "2026", "11", "21", "10", "2", "4"))
    assert sentence.is_echo(sentence.mini(1, 2, 0xABC), ("CAMUC", "1", "2", "abc"))
    assert sentence.is_echo(sentence.ping(1, 2), ("CAMPC", "01", "2"))
    assert not sentence.is_echo(sentence.ping(1, 2), ("CAMPC", "2", "1"))
    assert not sentence.is_echo(sentence.ping(1, 2), ("CAMPR", "1", "2", "0.1"))
    assert not sentence.is_echo(sentence.ping(1, 2), ("CAMPC",))


def test_the_time_for_transponders_is_there_and_back_and_the_turnaround():
    config = AcousticConfig(range_max_m=750.0)
    assert config.answer_s == pytest.approx(1.0 + 0.05 + 1.0)
    command = sentence.ping_remus(2, config.answer_s - 1.0, (True, False, True, False))
    assert command == ("CCPDT", "1", "2", "0", "0", "1050", "1", "0", "1", "0")
    command = sentence.ping_narrow_band(26000, 5, 5, 1.05, (25000, 0, 27000, 28000))
    assert command == ("CCPNT", "26000", "5", "5", "1050", "25000", "0", "27000", "28000", "1")


def test_commands_that_no_modem_takes_are_refused():
    for make in (
        lambda: sentence.mini(1, 2, 0x2000),
        lambda: sentence.ping_remus(5, 1.0, (True,) * 4),
        lambda: sentence.ping_remus(1, 1.0, (True,) * 3),
        lambda: sentence.ping_narrow_band(1, 1, 1, 1.0, (1, 2)),
    ):
        with pytest.raises(ValueError, match=r"\w+"):
            make()
