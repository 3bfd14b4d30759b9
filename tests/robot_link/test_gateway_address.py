"""The URIs of satellite and acoustic links."""

import pytest

from robot_link.station.gateway.address import (
    AcousticAddress,
    acoustic_address,
    camera_tags,
    check_link,
    cloudloop_thing,
    is_acoustic,
    is_cameras,
    is_satellite,
    own_end,
    satellite_address,
)

IMEI = "300234010753370"


def test_each_gateway_names_a_modem_by_its_imei():
    for carrier in ("rockblock", "directip"):
        assert satellite_address(f"{carrier}://{IMEI}") == (carrier, IMEI)
    uri = f"cloudloop://DgXeoxwVPM?imei={IMEI}"
    assert satellite_address(uri) == ("cloudloop", IMEI)
    assert cloudloop_thing(uri) == "DgXeoxwVPM"


def test_an_acoustic_modem_is_a_serial_line_or_a_tcp_port():
    assert acoustic_address("micromodem:///dev/ttyUSB1?us=1&peer=2") == AcousticAddress(
        "/dev/ttyUSB1", None, None, 19200, 1, 2
    )
    assert acoustic_address("micromodem://127.0.0.1:5005?us=0&peer=15&baud=9600") == (
        AcousticAddress(None, "127.0.0.1", 5005, 9600, 0, 15)
    )


def test_cameras_see_a_robot_by_the_tags_that_a_link_names():
    uri = "cameras:///?tags=mini-1"
    assert camera_tags(uri) == "mini-1"
    assert is_cameras(uri)
    assert not is_satellite(uri)
    assert own_end(uri) == "The set of tags mini-1"
    check_link(uri)


@pytest.mark.parametrize(
    "uri",
    [
        "rockblock://",
        "rockblock://12345",
        f"rockblock://{IMEI}?x=1",
        f"rockblock://{IMEI}/path",
        f"directip://{IMEI}0",
        "cloudloop://thing",
        f"cloudloop://?imei={IMEI}",
        "micromodem:///dev/ttyUSB1",
        "micromodem:///dev/ttyUSB1?us=1&peer=1",
        "micromodem:///dev/ttyUSB1?us=1&peer=16",
        "micromodem:///dev/ttyUSB1?us=1&peer=2&speed=3",
        "micromodem:///dev/ttyUSB1?us=1&peer=2&baud=0",
        "micromodem://?us=1&peer=2",
        "micromodem://127.0.0.1?us=1&peer=2",
        "micromodem://127.0.0.1:x?us=1&peer=2",
        "rockblock://[::1",
        "cameras:///",
        "cameras:///?tags=",
        "cameras://tank-1?tags=mini-1",
        "cameras:///tank?tags=mini-1",
        "cameras:///?tags=mini-1&fps=5",
        "carrier-pigeon://loft",
        "",
    ],
)
def test_what_names_no_link_is_refused_with_a_sentence(uri):
    with pytest.raises(ValueError, match=r"\w+ \w+"):
        check_link(uri)


def test_links_of_every_kind_are_told_apart():
    links = (
        "xbee:///dev/ttyUSB0",
        f"rockblock://{IMEI}",
        f"directip://{IMEI}",
        f"cloudloop://thing?imei={IMEI}",
        "micromodem:///dev/ttyUSB1?us=1&peer=2",
    )
    for uri in links:
        check_link(uri)
    assert [is_satellite(uri) for uri in links] == [False, True, True, True, False]
    assert [is_acoustic(uri) for uri in links] == [False] * 4 + [True]
