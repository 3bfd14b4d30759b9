"""Who opens an imported recording sees its dives, and takes every figure away."""

import csv
import io
import re
import time
from datetime import UTC, datetime

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, SHOTS, open_page
from tests.server.delivery.written import METADATA

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium"),
]
ROBOT = "eva"
DIVES, DIVE_S, REST_S, DEEP_M, STEP_S = 6, 900.0, 240.0, 30.0, 3.0
BEGIN = datetime(2026, 6, 3, 7, 0, tzinfo=UTC)
SIZES = {"wide": (1600, 950), "phone": (360, 780)}
FIGURES = ("Dives", "Section", "Profiles", "T-S", "Two channels", "Histogram")


def recording():
    """Return a table of dives through a thermocline that rises, with one value of no water."""
    rows = ["time,latitude,longitude,depth,temperature,salinity,chlorophyll"]
    random = np.random.default_rng(5)
    for at_s in np.arange(0.0, DIVES * (DIVE_S + REST_S) + REST_S, STEP_S).tolist():
        number, part = divmod(at_s, DIVE_S + REST_S)
        share = 1.0 - abs(2.0 * (part - REST_S) / DIVE_S - 1.0) if part > REST_S else 0.0
        depth = max(0.0, DEEP_M * share) + 0.03 * abs(random.standard_normal())
        thermocline = 16.0 - 1.2 * number
        warm = 1.0 / (1.0 + np.exp((depth - thermocline) / 2.0))
        temperature = 8.0 + 10.0 * warm + 0.05 * random.standard_normal()
        salinity = 35.2 - 0.8 * warm + 0.01 * random.standard_normal()
        chlorophyll = 0.2 + 3.0 * np.exp(-(((depth - thermocline) / 3.0) ** 2))
        if at_s == 900.0:
            temperature = 43.0
        place = f"{42.7 + 1e-6 * at_s:.7f},{-86.4 - 1e-6 * at_s:.7f}"
        values = f"{depth:.3f},{temperature:.4f},{salinity:.4f},{chlorophyll:.4f}"
        rows.append(f"{BEGIN.timestamp() + at_s:.1f},{place},{values}")
    return "\n".join(rows) + "\n"


def ended(demo, job):
    def state():
        told = demo.get(f"/api/jobs/{job}")
        return told["state"] not in ("queued", "running") and told

    told = demo.wait("the end of a job", state, 120.0)
    assert told["state"] == "done", told["message"]


@pytest.fixture(scope="module")
def path(screen, calm):
    """The path of a recording's deployment, which was checked."""
    cookies = {one["name"]: one["value"] for one in screen.context.cookies()}
    calm.client.cookies.update(cookies)
    calm.client.headers["X-CSRF-Token"] = calm.get("/api/session")["csrf_token"]
    files = {"file": ("eva.csv", recording(), "text/csv")}
    answer = calm.client.post("/api/imports", files=files, data={"robot": ROBOT})
    assert answer.is_success, answer.text
    ended(calm, answer.json()["id"])
    (deployment,) = calm.get("/api/deployments", robot=ROBOT)["deployments"]
    found = f"/api/deployments/{deployment['id']}"
    ended(calm, calm.post(f"{found}/quality")["id"])
    return found


@pytest.fixture
def panel(screen, calm, path):
    screen.set_viewport_size({"width": 1600, "height": 950})
    screen.goto("about:blank")  # what an earlier test chose is gone
    open_page(screen, calm, f"/data/{ROBOT}#{path.rpartition('/')[2]}")
    found = screen.get_by_role("region", name="Analysis")
    expect(picture_of(found)).to_be_visible()
    return found


def picture_of(panel):
    return panel.locator("figure svg[role=img]")


def choose(panel, figure):
    panel.get_by_text(figure, exact=True).first.click()
    title = {"T-S": "T-S", "Two channels": " over ", "Histogram": "histogram"}.get(figure, "")
    expect(panel.get_by_role("img", name=re.compile(f"{title}.*·"))).to_be_visible()


def saved(screen, panel, kind):
    """Press a button that gives a file; return its name and content."""
    with screen.expect_download() as loaded:
        panel.get_by_text(kind, exact=True).click()
    with open(loaded.value.path(), "rb") as file:
        return loaded.value.suggested_filename, file.read()


def test_every_dive_is_in_the_list_and_one_of_them_is_shown(screen, panel):
    rows = panel.get_by_role("row")
    expect(rows).to_have_count(1 + DIVES)
    expect(rows.nth(2)).to_contain_text("30.")
    panel.get_by_role("button", name="Show dive 2 alone").click()
    expect(panel.get_by_role("img", name=re.compile("dives 2"))).to_be_visible()
    name, content = saved(screen, panel, "CSV")
    assert name.endswith(".csv")
    lines = [line for line in content.decode().splitlines() if not line.startswith("#")]
    table = list(csv.DictReader(io.StringIO("\n".join(lines))))
    assert {row["dive"] for row in table} == {"2"}
    assert len(table) == pytest.approx(DIVE_S / STEP_S, abs=4)


@pytest.mark.parametrize("figure", FIGURES)
def test_every_figure_leaves_as_svg_png_and_csv(screen, panel, figure):
    choose(panel, figure)
    name, svg = saved(screen, panel, "SVG")
    assert name.endswith(".svg")
    assert b"<svg" in svg
    assert b"var(--" not in svg
    name, png = saved(screen, panel, "PNG")
    assert name.endswith(".png")
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    assert picture.getpixel((2, 2)) == (255, 255, 255)
    assert len(picture.getcolors(1 << 20) or [0] * 99) > 20
    _, table = saved(screen, panel, "CSV")
    assert len(table.decode().splitlines()) >= DIVES


def test_a_figure_is_zoomed_by_dragging_and_by_keys(screen, panel):
    choose(panel, "Section")
    picture = picture_of(panel)
    labels = "each => each.map(one => one.textContent).join(' ')"
    whole = picture.locator("text").evaluate_all(labels)
    box = picture.bounding_box()
    screen.mouse.move(box["x"] + 300, box["y"] + 80)
    screen.mouse.down()
    screen.mouse.move(box["x"] + 500, box["y"] + 200)
    screen.mouse.up()
    part = picture.locator("text").evaluate_all(labels)
    assert part != whole
    picture.dblclick(position={"x": 200, "y": 100})
    assert picture.locator("text").evaluate_all(labels) == whole
    button = panel.get_by_role("button", name="Zoom in")
    button.focus()
    screen.keyboard.press("Enter")
    middle = picture.locator("text").evaluate_all(labels)
    screen.keyboard.press("ArrowRight")
    assert picture.locator("text").evaluate_all(labels) != middle != whole
    panel.get_by_role("button", name="All of it").click()
    assert picture.locator("text").evaluate_all(labels) == whole


def test_bad_values_are_marked_and_left_out_on_demand(panel):
    choose(panel, "Histogram")
    panel.get_by_role("combobox").select_option("temperature")
    statistics = panel.get_by_role("table")
    expect(statistics).to_contain_text("43.000")
    choose(panel, "Section")
    expect(panel.locator("svg text").filter(has_text=re.compile("^bad$"))).to_be_visible()
    choose(panel, "Histogram")
    panel.get_by_text("No bad ones").click()
    expect(statistics).not_to_contain_text("43.000")


def test_what_is_no_dive_is_named(panel):
    choose(panel, "Section")
    panel.get_by_role("textbox").fill("2-x")
    expect(panel.get_by_role("alert")).to_contain_text("1 field is wrong")


def test_the_line_below_each_figure_draws_it_from_the_delivered_file(
    panel, screen, calm, path, tmp_path, monkeypatch
):
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    pyplot = pytest.importorskip("matplotlib.pyplot", reason="matplotlib is not installed")
    calm.patch("/api/config/delivery", METADATA.model_dump(mode="json"), robot=ROBOT)
    ended(calm, calm.post(f"{path}/files", {"no_better_data": False})["id"])
    (file,) = calm.get(f"{path}/files")["files"]
    (tmp_path / file["name"]).write_bytes(calm.client.get(f"{path}/files/{file['id']}").content)
    monkeypatch.chdir(tmp_path)
    pyplot.switch_backend("Agg")
    screen.reload()
    expect(picture_of(panel)).to_be_visible()
    for figure in FIGURES:
        choose(panel, figure)
        for kept in ("Good ones", "All values") if figure != "Dives" else ("Depth", "Duration"):
            panel.get_by_text(kept, exact=True).first.click()
            line = panel.locator("code").inner_text()
            assert file["name"] in line
            pyplot.figure()
            exec(line, {})
            assert pyplot.gca().has_data(), line
            pyplot.close("all")
    assert xarray


@pytest.mark.parametrize("theme", ["Day", "Night red"])
def test_figures_can_be_looked_at(screen, panel, theme):
    screen.get_by_role("button", name="demo").click()
    screen.get_by_text(theme, exact=True).first.click()
    screen.keyboard.press("Escape")
    for size, (width, height) in SIZES.items():
        screen.set_viewport_size({"width": width, "height": height})
        for figure in FIGURES:
            choose(panel, figure)
            time.sleep(0.4)
            panel.scroll_into_view_if_needed()
            name = f"analysis-{figure}-{theme}-{size}".lower().replace(" ", "-")
            panel.screenshot(path=SHOTS / f"{name}.png")
            wide = "each => each.scrollWidth - each.clientWidth"
            assert panel.evaluate(wide) <= 1
