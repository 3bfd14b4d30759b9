"""viser's page as it is served."""

import gzip

from webui.scene.page import page


def test_a_framed_page_hides_visers_panel_and_a_page_alone_keeps_it() -> None:
    alone = gzip.decompress(page(is_framed=False)).decode()
    framed = gzip.decompress(page(is_framed=True)).decode()
    assert ".mantine-Paper-root,\n.mantine-Notification-root" not in alone
    before, after = framed.split("<style>\n.mantine-Paper-root", 1)
    assert alone.startswith(before)
    assert after.split("</style>", 1)[1] == alone[len(before) :]
