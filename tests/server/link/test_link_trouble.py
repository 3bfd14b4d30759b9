"""What is wrong with a link beside its state reaches the operator."""

from datetime import UTC, datetime

from robot_link.messages import LinkReport, LinkState, RobotId
from tests.server.conftest import MINI

DOUBLE = "another radio (00000000000000A2) speaks as system 1; it is not obeyed"


async def text_of_link(client) -> str:
    (link,) = (await client.get(f"/api/robots/{MINI}/links")).json()
    return link["text"]


async def test_a_second_radio_under_a_robots_system_id_is_told_beside_its_link(client, world):
    def hear(trouble: str) -> None:
        now = datetime.now(UTC)
        live = LinkState.LIVE
        world.tell(LinkReport(RobotId(MINI), "xbee", live, now, -50.0, 9, 0, trouble=trouble))

    hear("")
    assert (await text_of_link(client)).endswith("hears mini-1 now.")
    hear(DOUBLE)
    assert (await text_of_link(client)).endswith(f"hears mini-1 now. A{DOUBLE[1:]}.")
