"""Reports and moments: one file that loads nothing, and a robot as it was known then."""

import io
import re
from datetime import UTC, datetime, timedelta
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest
from PIL import Image

from server.logbook.figure import Curve, curve_figure, track_figure
from tests.server.conftest import GRACE, MINI, until
from tests.server.fake_link import state_report
from tests.server.logbook.test_entries import write
from tests.server.logbook.test_watch import signed, take

START = datetime(2026, 11, 21, 4, 0, tzinfo=UTC)


class Loaded(HTMLParser):
    """What a browser would load of a page, and what would run in it."""

    def __init__(self, html):
        super().__init__()
        self.addresses, self.tags = [], []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        loading = {"src", "srcset", "data", "poster", "xlink:href", "action"}
        self.addresses += [value for name, value in attrs if name in loading]
        self.addresses += [value for name, value in attrs if name == "href" and tag != "a"]


async def test_a_report_has_everything_inside_and_loads_nothing(ann, ben):
    file = io.BytesIO()
    Image.new("RGB", (4, 3), "red").save(file, "PNG")
    sent = await ann.post(
        "/api/logbook/attachments", files={"file": ("a.png", file.getvalue(), "image/png")}
    )
    picture = {"sha256": sent.json()["sha256"], "name": "pump"}
    await write(ann, "![x](https://evil.example/b.png) <script>1</script>", robot=MINI,
                attachments=[picture])  # fmt: skip
    struck = await write(ann, "Struck words.")
    await ann.delete(f"/api/logbook/entries/{struck['id']}", params={"version": 1})
    page = await signed(ann, remarks="Watch <b>the</b> leak.")
    await take(ben, page)
    answer = await ann.get("/api/logbook/report")
    assert answer.status_code == 200, answer.text
    html = answer.text
    seen = Loaded(html)
    assert seen.addresses
    assert all(one.startswith("data:image/png;base64,") for one in seen.addresses)
    assert not {"script", "link", "iframe", "object", "base"} & set(seen.tags)
    assert "url(" not in html
    assert "default-src 'none'" in html
    assert answer.headers["content-security-policy"].endswith("sandbox")
    for words in ("SIMULATION", "Struck out by ann", page["sha256"], "taken over by <b>ben</b>",
                  "wind 3.5 m/s", "&lt;script&gt;", "Watch &lt;b&gt;"):  # fmt: skip
        assert words in html, words
    assert html.rstrip().endswith("</html>")


@pytest.mark.parametrize("span", ["shift=mine", "span=day", "span=week"])
async def test_a_report_names_nothing_outside_and_its_figures_are_whole(ann, world, span):
    assert (await ann.post("/api/logbook/shifts")).status_code == 201
    world.tell(state_report(MINI, (1.2, 0.6, 0.3)))
    await write(ann, "See [the chart](https://charts.example/a) and ![](//evil.example/x).")

    async def drawn():
        told = (await ann.get(f"/api/logbook/report?{span}")).text
        return told if "<svg" in told else None

    html = await until(drawn)
    outside = re.sub(r'<a [^>]*href="https://charts\.example/a"[^>]*>', "", html)
    assert not re.findall(r"""(?:https?:)?//[\w.-]+|url\(|@import|javascript:""",
                          re.sub(r"!\[\]\(//evil\.example/x\)", "", outside))  # fmt: skip
    figures = re.findall(r"<svg.*?</svg>", html, re.DOTALL)
    assert figures
    for figure in figures:
        root = ElementTree.fromstring(figure)
        width, height = (float(one) for one in root.attrib["viewBox"].split()[2:])
        assert root.attrib["aria-label"]
        names = {one.tag for one in root.iter()}
        assert names <= {"svg", "path", "polyline", "circle", "text", "rect"}
        for line in root.iter("polyline"):
            for point in line.attrib["points"].split():
                x, y = (float(one) for one in point.split(","))
                assert 0.0 <= x <= width
                assert 0.0 <= y <= height
    assert html.count("<figure>") == html.count("</figure>") == len(figures)


async def test_a_report_is_of_its_time_and_robot(ann, still):
    old = (still - timedelta(days=3)).isoformat()
    await write(ann, "Three days old.", at=old)
    await write(ann, "Of mini.", robot=MINI)
    await write(ann, "Of grace.", robot=GRACE)
    day = (await ann.get("/api/logbook/report")).text
    assert ("Three days old." in day, "Of mini." in day, "Of grace." in day) == (False, True, True)
    assert "Three days old." in (await ann.get("/api/logbook/report?span=week")).text
    mini = (await ann.get("/api/logbook/report", params={"robot": MINI})).text
    assert ("Of mini." in mini, "Of grace." in mini) == (True, False)
    assert (await ann.get("/api/logbook/report?shift=mine")).status_code == 409
    backwards = {"from": still.isoformat(), "to": old}
    assert (await ann.get("/api/logbook/report", params=backwards)).status_code == 422


def test_a_curve_breaks_where_nothing_was_heard():
    minutes = [*range(20), *range(40, 60)]
    at = [START + timedelta(minutes=one) for one in minutes]
    curve = Curve("Depth", "m", at, [float(one % 7) for one in minutes], is_downwards=True)
    figure = curve_figure(curve, START, START + timedelta(hours=1))
    assert figure.count("<polyline") == 2
    assert "Depth, m" in figure
    lowest = max(float(y) for y in re.findall(r"[\d.]+,([\d.]+)", figure))
    assert lowest <= 164.1


def test_depth_is_drawn_downwards_and_a_voltage_upwards():
    at = [START, START + timedelta(seconds=30)]
    for is_downwards in (True, False):
        figure = curve_figure(
            Curve("x", "", at, [1.0, 9.0], is_downwards), START, START + timedelta(hours=1)
        )
        first, last = (float(y) for y in re.findall(r"[\d.]+,([\d.]+)", figure))
        assert (last > first) == is_downwards


def test_the_noise_of_a_robot_at_the_surface_does_not_look_like_a_dive():
    at = [START, START + timedelta(minutes=30)]
    curve = Curve("Depth", "m", at, [0.0, 0.004], is_downwards=True, least_span=1.0)
    figure = curve_figure(curve, START, START + timedelta(hours=1))
    (first, last) = (float(y) for y in re.findall(r'cy="([\d.]+)"', figure))
    assert abs(last - first) < 1.0
    assert re.findall(r'end">([^<]+)<', figure)[-2] == "1"
    assert "e-" not in "".join(re.findall(r">([^<]*)</text>", figure))


def test_names_of_the_ends_of_a_track_stay_within_its_frame():
    eastward = track_figure("x", [0.0, 0.0], [0.0, 20.0])
    westward = track_figure("x", [0.0, 0.0], [20.0, 0.0])
    named = r'text x="([\d.]+)" y="[\d.]+" text-anchor="(\w+)"[^>]*>(begin|end)<'
    for figure in (eastward, westward):
        ends = {name: (float(x), anchor) for x, anchor, name in re.findall(named, figure)}
        assert set(ends) == {"begin", "end"}
        for x, anchor in ends.values():
            left, right = (x - 35.0, x) if anchor == "end" else (x, x + 35.0)
            assert left >= 0.0
            assert right <= 460.0


def test_nothing_is_drawn_of_nothing_and_one_value_is_a_dot():
    end = START + timedelta(hours=1)
    assert curve_figure(Curve("x", "m", [], []), START, end) == ""
    assert curve_figure(Curve("x", "m", [START], [float("nan")]), START, end) == ""
    assert "<circle" in curve_figure(Curve("x", "m", [START], [5.0]), START, end)
    assert track_figure("x", [], []) == ""
    assert "<svg" in track_figure("<x>", [0.0], [0.0])
    assert "<x>" not in track_figure("<x>", [0.0], [0.0])
