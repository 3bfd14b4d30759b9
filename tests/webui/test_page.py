"""viser's page as it is served."""

import gzip
from importlib.resources import files

from webui.scene.page import page
from webui.scene.projection import VIEW_WIDTH


def test_a_framed_page_hides_visers_panel_and_a_page_alone_keeps_it() -> None:
    alone = gzip.decompress(page(is_framed=False)).decode()
    framed = gzip.decompress(page(is_framed=True)).decode()
    bare = "\n.mantine-Paper-root,\n.mantine-Notification-root"
    assert bare not in alone
    before, after = framed.split(bare, 1)
    assert alone.startswith(before)
    assert after.split("</style>", 1)[1] == alone[len(before) :].split("</style>", 1)[1]


def test_the_sky_is_there_before_any_script_and_our_scripts_before_visers() -> None:
    content = gzip.decompress(page(is_framed=True)).decode()
    scene = files("webui") / "scene"
    ours = [content.index((scene / name).read_text()) for name in ("frame.js", "pace.js")]
    scripts = [at for at in range(len(content)) if content.startswith("<script", at)]
    assert content.index("--sky") < scripts[0]
    assert scripts[0] < ours[0] < scripts[1] < ours[1] < scripts[2]
    assert len(scripts) == 3


def test_visers_client_keeps_its_camera_where_the_app_looks_for_it() -> None:
    client = (files("viser") / "client" / "src" / "App.tsx").read_text()
    context = (files("viser") / "client" / "src" / "ViewerContext.ts").read_text()
    assert "w.__viserMutable = mutable.current;" in client
    assert "camera: THREE.PerspectiveCamera | null;" in context
    assert "nodeRefFromName: {" in context


def test_the_app_reckons_with_the_width_of_the_view() -> None:
    reckoned = (files("webui") / "app" / "src" / "chart" / "scene_camera.ts").read_text()
    assert f"const VIEW_WIDTH = {VIEW_WIDTH:g};" in reckoned
