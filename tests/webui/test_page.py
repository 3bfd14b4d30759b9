"""viser's page as it is served."""

import gzip
from importlib.resources import files

from webui.scene.page import page


def test_a_framed_page_hides_visers_panel_and_a_page_alone_keeps_it() -> None:
    alone = gzip.decompress(page(is_framed=False)).decode()
    framed = gzip.decompress(page(is_framed=True)).decode()
    assert ".mantine-Paper-root,\n.mantine-Notification-root" not in alone
    pace = (files("webui") / "scene" / "pace.js").read_text()
    assert pace not in alone
    paced = framed.replace(f"<script>{pace}</script>", "", 1)
    assert framed.index(pace) < framed.index("<script", framed.index(pace) + len(pace))
    before, after = paced.split("<style>\n.mantine-Paper-root", 1)
    assert alone.startswith(before)
    assert after.split("</style>", 1)[1] == alone[len(before) :]
