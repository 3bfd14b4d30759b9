import pytest

from robot_link.messages import LinkState
from server.fleet.routing import RADIO_ONLY, KnownLinks, choose_links
from tests.server.sky import ManualClock

NOW = ManualClock().now()
EARLIER = NOW.replace(hour=9)


def known_links(
    radio=LinkState.STALE, satellite=LinkState.LIVE, *, radio_at=EARLIER, satellite_at=NOW
):
    return KnownLinks(radio, radio_at, satellite, satellite_at)


@pytest.mark.parametrize(
    ("known", "requested", "taken"),
    [
        (known_links(LinkState.LIVE), "auto", ("radio",)),
        (known_links(LinkState.STALE), "auto", ("satellite",)),
        (known_links(LinkState.NEVER_HEARD), "auto", ("satellite",)),
        (known_links(LinkState.DISABLED), "auto", ("satellite",)),
        (known_links(LinkState.PORT_CLOSED), "auto", ("satellite",)),
        (known_links(LinkState.SUBMERGED, radio_at=NOW, satellite_at=EARLIER), "auto", ("radio",)),
        (known_links(LinkState.SUBMERGED), "auto", ("satellite",)),
        (known_links(LinkState.STALE, None), "auto", ("radio",)),
        (known_links(LinkState.STALE, LinkState.DISABLED), "auto", ("radio",)),
        (known_links(None), "auto", ("satellite",)),
        (known_links(LinkState.LIVE), "satellite", ("satellite",)),
        (known_links(LinkState.STALE), "radio", ("radio",)),
        (known_links(LinkState.LIVE, None), "satellite", ()),
        (known_links(LinkState.LIVE, LinkState.DISABLED), "satellite", ()),
        (known_links(None), "radio", ()),
    ],
)
@pytest.mark.parametrize("kind", ["plan", "command"])
def test_satellite_is_taken_only_where_radio_does_not_reach_or_on_request(
    kind, known, requested, taken
):
    by_request = choose_links(kind, known, "auto", requested)
    assert by_request.links == taken
    assert by_request.reason.endswith(".")
    assert choose_links(kind, known, requested).links == taken, "the setting says the same"


def test_word_of_the_operator_goes_before_the_setting():
    assert choose_links("plan", known_links(), "satellite", "radio").links == ("radio",)


@pytest.mark.parametrize("kind", RADIO_ONLY)
@pytest.mark.parametrize("requested", ["auto", "satellite"])
@pytest.mark.parametrize("radio", [LinkState.LIVE, LinkState.STALE, LinkState.PORT_CLOSED])
def test_streams_parameters_and_files_never_go_by_satellite(kind, requested, radio):
    assert choose_links(kind, known_links(radio), "satellite", requested).links == ("radio",)


@pytest.mark.parametrize("radio", list(LinkState))
def test_order_to_surface_goes_by_every_link_at_once(radio):
    assert choose_links("surface", known_links(radio), "radio").links == ("radio", "satellite")
