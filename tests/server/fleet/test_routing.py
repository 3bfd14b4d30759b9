import pytest

from robot_link.messages import LinkState
from server.fleet.routing import RADIO_ONLY, Roads, carriers_for
from tests.server.sky import ManualClock

NOW = ManualClock().now()
EARLIER = NOW.replace(hour=9)


def roads(radio=LinkState.STALE, satellite=LinkState.LIVE, *, radio_at=EARLIER, satellite_at=NOW):
    return Roads(radio, radio_at, satellite, satellite_at)


@pytest.mark.parametrize(
    ("known", "wish", "taken"),
    [
        (roads(LinkState.LIVE), "auto", ("radio",)),
        (roads(LinkState.STALE), "auto", ("satellite",)),
        (roads(LinkState.NEVER_HEARD), "auto", ("satellite",)),
        (roads(LinkState.UNPLUGGED), "auto", ("satellite",)),
        (roads(LinkState.PORT_CLOSED), "auto", ("satellite",)),
        (roads(LinkState.SUBMERGED, radio_at=NOW, satellite_at=EARLIER), "auto", ("radio",)),
        (roads(LinkState.SUBMERGED), "auto", ("satellite",)),
        (roads(LinkState.STALE, None), "auto", ("radio",)),
        (roads(LinkState.STALE, LinkState.UNPLUGGED), "auto", ("radio",)),
        (roads(None), "auto", ("satellite",)),
        (roads(LinkState.LIVE), "satellite", ("satellite",)),
        (roads(LinkState.STALE), "radio", ("radio",)),
        (roads(LinkState.LIVE, None), "satellite", ()),
        (roads(LinkState.LIVE, LinkState.UNPLUGGED), "satellite", ()),
        (roads(None), "radio", ()),
    ],
)
@pytest.mark.parametrize("kind", ["plan", "command"])
def test_satellite_is_taken_only_where_radio_does_not_reach_or_on_request(kind, known, wish, taken):
    by_wish = carriers_for(kind, known, "auto", wish)
    assert by_wish.roads == taken
    assert by_wish.reason.endswith(".")
    assert carriers_for(kind, known, wish).roads == taken, "the setting says the same"


def test_word_of_the_operator_goes_before_the_setting():
    assert carriers_for("plan", roads(), "satellite", "radio").roads == ("radio",)


@pytest.mark.parametrize("kind", RADIO_ONLY)
@pytest.mark.parametrize("wish", ["auto", "satellite"])
@pytest.mark.parametrize("radio", [LinkState.LIVE, LinkState.STALE, LinkState.PORT_CLOSED])
def test_streams_parameters_and_files_never_go_by_satellite(kind, wish, radio):
    assert carriers_for(kind, roads(radio), "satellite", wish).roads == ("radio",)


@pytest.mark.parametrize("radio", list(LinkState))
def test_order_to_surface_goes_by_every_link_at_once(radio):
    assert carriers_for("surface", roads(radio), "radio").roads == ("radio", "satellite")
