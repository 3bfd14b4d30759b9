"""The catalogue of channels: complete, without two that could be taken for each other."""

import pytest

from autonomy.channel import CHANNELS, OWN_WIRE_NUMBERS, Channel, ChannelCatalogue


def test_every_delivered_channel_can_be_named_on_the_wire_or_is_derived() -> None:
    for key, channel in CHANNELS.items():
        assert key == channel.key
        if channel.derived_from:
            assert channel.wire_number == 0
            assert set(channel.derived_from) <= set(CHANNELS)
        else:
            assert CHANNELS.numbered(channel.wire_number) is channel
            assert channel.wire_number not in OWN_WIRE_NUMBERS


def test_robots_that_know_three_variables_are_understood() -> None:
    known = [CHANNELS.numbered(number) for number in (1, 2, 3)]
    assert [one and one.key for one in known] == ["blue_light", "chlorophyll", "temperature"]
    assert CHANNELS.numbered(0) is None


@pytest.mark.parametrize(("key", "number"), [("temperature", 200), ("mine", 3)])
def test_two_channels_that_cannot_be_told_apart_are_refused(key: str, number: int) -> None:
    with pytest.raises(ValueError, match=r"temperature.*cannot be told apart"):
        CHANNELS.with_own([Channel(key, "Mine", "1", number)])


def test_a_team_adds_its_own() -> None:
    grown = CHANNELS.with_own([Channel("methane", "Methane", "nmol/L", 128, low=0.0, high=1e5)])
    assert grown["methane"].fault(-1.0) is not None
    assert grown.numbered(128) is grown["methane"]
    assert isinstance(grown, ChannelCatalogue)
    assert "methane" not in CHANNELS


def test_alarm_limits_lie_inside_of_what_can_be_true() -> None:
    for channel in CHANNELS.values():
        for limit in channel.alarms:
            ends = [end for end in (limit.low, limit.high) if end is not None]
            assert ends
            assert all(channel.low <= end <= channel.high for end in ends)
