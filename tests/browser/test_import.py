"""A data manager brings in recordings of others: a table of unknown columns, two makers' files."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, SHOTS, browser_page, open_page
from tests.e2e.demo import Demo

GLIDERS = Path("../shared/data/glider")
"""Files of third parties, which are beside the project where they are at hand."""
pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
ROWS = 240
COLUMNS = {
    "stamp": ("time", ""),
    "north": ("latitude", "degree_north"),
    "east": ("longitude", "degree_east"),
    "below": ("depth", "cm"),
    "warmth": ("variable:temperature", "degF"),
    "mood": ("other", "points"),
}


def unknown_table() -> str:
    """Return a table whose names say nothing, whose depths are in cm, and whose day is first."""
    lines, at = [",".join(COLUMNS)], datetime(2026, 8, 3, 10, 0, 0, tzinfo=UTC)
    for row in range(ROWS):
        depth_cm = 100.0 * abs(row % 40 - 20) / 20.0
        at += timedelta(seconds=2)
        place = f"{42.7 + 1e-6 * row:.6f},{-84.4 - 1e-6 * row:.6f}"
        lines.append(
            f"{at:%d.%m.%Y %H:%M:%S},{place},{depth_cm:.1f},{70.0 - 0.02 * depth_cm:.3f},{row % 7}"
        )
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    with Demo(tmp_path_factory.mktemp("tank"), "--robots", "mini-1") as demo:
        yield demo


@pytest.fixture(scope="module")
def sheet(browser, tank):
    with browser_page(browser, tank) as page:
        for one in page.context.cookies():
            tank.client.cookies.set(one["name"], one["value"])
        yield page


def panel_of(sheet, tank):
    open_page(sheet, tank, "/data/mini-1")
    return sheet.locator("form").filter(has_text="Import a recording")


def bring_in(panel, robot):
    """Confirm what is proposed, and wait until every row is accounted for; return the sentence."""
    panel.get_by_label("Name of the robot that recorded it").fill(robot)
    panel.get_by_role("button", name=re.compile("^Import .* rows$")).click()
    told = panel.get_by_role("status").filter(has_text="rows read")
    expect(told).to_be_visible()
    text = " ".join(told.inner_text().split())
    found = re.match(
        r"([\d,]+) rows read: ([\d,]+) new, ([\d,]+) duplicate, ([\d,]+) different, "
        r"([\d,]+) faulty\. They are in (deployment-\d+) of (\S+)\.",
        text,
    )
    assert found, text
    read, *parts = (int(one.replace(",", "")) for one in found.groups()[:5])
    assert read == sum(parts)
    assert found[7] == robot
    return read, parts, found[6]


def test_a_table_of_unknown_columns_is_mapped_column_by_column(sheet, tank, tmp_path):
    table = tmp_path / "strange.csv"
    table.write_text(unknown_table())
    panel = panel_of(sheet, tank)
    panel.get_by_label("Files").set_input_files(table)
    expect(panel.get_by_role("status").filter(has_text=f"{ROWS} rows")).to_be_visible()
    for name, (meaning, unit) in COLUMNS.items():
        panel.get_by_label(f"{name} becomes").select_option(meaning)
        if unit:
            panel.get_by_label(f"Unit of {name}").fill(unit)
    panel.get_by_label("Keep this mapping as (optional)").fill("strange table")
    sheet.screenshot(path=SHOTS / "import-mapping.png", full_page=True)
    bring = panel.get_by_role("button", name=re.compile("^Import .* rows$"))
    panel.get_by_label("Name of the robot that recorded it").fill("buoy-1")
    bring.click()
    expect(
        panel.get_by_text(re.compile("The mapping cannot be followed.*day first"))
    ).to_be_visible()
    panel.get_by_text("Day first", exact=True).click()
    panel.get_by_role("checkbox", name=re.compile("they are UTC")).check()
    read, (new, *_), deployment = bring_in(panel, "buoy-1")
    assert (read, new) == (ROWS, ROWS)
    sheet.screenshot(path=SHOTS / "import-done.png", full_page=True)
    path = "/api/robots/buoy-1/samples"
    kept = tank.get(path, channel="temperature", deployment=deployment)
    assert len(kept["value"]) == ROWS
    depth_cm = 100.0
    assert kept["value"][0] == pytest.approx((70.0 - 0.02 * depth_cm - 32.0) / 1.8, abs=1e-3)
    assert kept["measured_at"][0].startswith("2026-08-03T10:00:02")

    open_page(sheet, tank, f"/data/buoy-1#{deployment}")
    others = sheet.get_by_role("region", name="Other series")
    expect(others.get_by_role("row", name=re.compile(f"mood points {ROWS}"))).to_be_visible()
    sheet.screenshot(path=SHOTS / "import-other-series.png", full_page=True)

    # The same file again: its mapping is known, and every row is.
    panel = panel_of(sheet, tank)
    panel.get_by_label("Files").set_input_files(table)
    expect(panel.get_by_label("warmth becomes")).to_have_value("variable:temperature")
    expect(panel.get_by_label("Unit of below")).to_have_value("cm")


@pytest.mark.skipif(not GLIDERS.is_dir(), reason=f"{GLIDERS} is not here")
@pytest.mark.parametrize(
    ("robot", "names"),
    [
        ("amadeus", ["amadeus-2014-204-05-000.dbd", "amadeus-2014-204-05-000.ebd", "cac/*.cac"]),
        ("sg542", ["p5420304.nc"]),
    ],
)
def test_files_of_other_makers_are_known_by_their_content(sheet, tank, robot, names):
    panel = panel_of(sheet, tank)
    files = [path for name in names for path in sorted(GLIDERS.glob(name))]
    panel.get_by_label("Files").set_input_files(files)
    expect(panel.get_by_role("status").filter(has_text="rows of")).to_be_visible()
    # Records from before the first fix have no place; to refuse all for them is the other choice.
    panel.get_by_text("Skip it and say so").click()
    read, (new, *_), deployment = bring_in(panel, robot)
    assert read > 0
    assert new > 0
    open_page(sheet, tank, f"/data/{robot}")
    past = sheet.get_by_role("region", name="Deployments")
    expect(past.get_by_role("link")).not_to_have_count(0)
    past.get_by_role("link").first.click()
    expect(sheet.get_by_role("region", name="Quality")).to_be_visible()
    sheet.screenshot(path=SHOTS / f"import-{robot}.png", full_page=True)
    assert deployment in sheet.url
