"""Ten files of each format: read as they are meant, or refused in words, by item, line or feature.

A case names the file, and either the error that refuses it as a whole, or what a proposal must
have: how many waypoints, which parts are refused and why, which question is asked.
"""

import io
import json
import zipfile
from dataclasses import dataclass

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from autonomy.design.document import WAYPOINTS_MAX, Way
from autonomy.site import LAKE
from server.plan_file.proposal import PlanFileProposal, ReadChoices
from server.plan_file.reading import BYTES_MAX, read_plan_file
from server.water.proposal import ReadingError
from tests.server.plan_file.public import fence, flown, plan, simple_item, survey, waypoint, wpl
from tests.server.water.foreign import feature, geojson, kml, pin, placemark

HERE = (42.762, -84.377)
"""In the practice lake."""
EAST = (42.762, -84.376)
BOW_TIE = [(42.762, -84.377), (42.763, -84.376), (42.762, -84.376), (42.763, -84.377)]


@dataclass(frozen=True)
class Case:
    name: str
    content: bytes
    error: str = ""
    """Of the whole file; "" if it is read."""
    waypoints: int = 0
    refused: tuple[tuple[str, str], ...] = ()
    """Place and a part of the reason of each."""
    asks: tuple[str, ...] = ()
    notes: str = ""


def line(*places: tuple[float, ...], **words: object) -> bytes:
    coordinates = [[at[1], at[0], *at[2:]] for at in places]
    return geojson(feature("LineString", coordinates, **words))


def kml_line(*places: tuple[float, ...], mode: str = "absolute", more: str = "") -> bytes:
    text = " ".join(",".join(map(str, (at[1], at[0], *at[2:]))) for at in places)
    altitude = f"<altitudeMode>{mode}</altitudeMode>" if mode else ""
    return kml(
        f"<Placemark>{more}<LineString>{altitude}<coordinates>{text}</coordinates></LineString>"
        "</Placemark>"
    )


def kml_ring(places: list[tuple[float, float]]) -> str:
    return placemark([[b, a] for a, b in [*places, places[0]]])


def zipped(**entries: bytes) -> bytes:
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name.replace("_kml", ".kml"), content)
    return kept.getvalue()


def csv(*rows: str, head: str = "name,latitude_deg,longitude_deg,depth_m") -> bytes:
    return "\n".join((head, *rows)).encode() + b"\n"


def changed(**more: object) -> bytes:
    """Return a plan with other fields at its top."""
    return json.dumps(json.loads(plan([waypoint(1, *HERE, -5)])) | more).encode()


MANY = [(42.762 + 1e-6 * k, -84.377, -5.0) for k in range(WAYPOINTS_MAX + 1)]
MANY_WORDS = "501 waypoints are more than the 500"
OLD_MISSION = {"version": 1, "items": []}
BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]>'
LINK = "<NetworkLink><Link><href>http://127.0.0.1/x.kml</href></Link></NetworkLink>"
ABOVE = "5.0 m above the water"
NO_PLACE = "stands for no place"
CROSSES = "crosses itself: the side after corner 1 meets the side after corner 3"

PLAN = [
    Case("valid", plan([waypoint(1, *HERE, -5), waypoint(2, *EAST, 0)]), waypoints=2),
    Case("broken", plan([waypoint(1, *HERE, -5)])[:-9], "line 1: no JSON"),
    Case("broken item", plan([{"type": "SimpleItem", "command": 16}]), "item 1: needs the numbers"),
    Case("huge", plan([waypoint(k, *at) for k, at in enumerate(MANY)]), MANY_WORDS),
    Case("wrong version", changed(version=2), "version: 2 is not taken, 1 is"),
    Case("wrong mission", changed(mission=OLD_MISSION), "mission.version: 1 is not taken, 2 is"),
    Case("no plan", changed(fileType="Fence"), "fileType: 'Fence' is no plan"),
    Case(
        "self-crossing",
        plan(polygons=[fence(BOW_TIE)]),
        refused=(("geoFence.polygons 1", CROSSES),),
    ),
    Case("empty", plan(), "holds no waypoint, no area and no place"),
    Case("nothing", b"", "the file is empty"),
    Case(
        "above the water",
        plan([waypoint(1, *HERE, 5), waypoint(2, *EAST, -5)]),
        waypoints=1,
        refused=(("item 1", ABOVE),),
        asks=("turns_sign", "imports_rest"),
    ),
    Case(
        "hardly above the water",
        plan([waypoint(1, *HERE, 0.4)]),
        waypoints=1,
        notes="item 1: 0.4 m above the water is taken as its surface",
    ),
    Case(
        "above the sea in a lake",
        plan([simple_item(1, 16, 0, 0, 0, 0, None, *HERE, 250.0)]),
        refused=(("item 1", "nobody said how high this water stands"),),
        asks=("surface_altitude_m",),
    ),
    Case(
        "no altitude",
        plan([waypoint(1, *HERE, None)]),
        waypoints=1,
        asks=("default_depth_m",),
    ),
    Case(
        "deeper than the sea",
        plan([waypoint(1, *HERE, -20_000)]),
        refused=(("item 1", "deeper than any water"),),
    ),
    Case("nowhere", plan([waypoint(1, 0, 0, -5)]), refused=(("item 1", NO_PLACE),)),
    Case(
        "beyond the pole",
        plan([waypoint(1, 90.5, 0, -5)]),
        refused=(("item 1", "latitude 90.5"),),
    ),
    Case("NaN", plan([waypoint(1, *HERE, float("nan"))]), "NaN is no number of JSON"),
    Case(
        "jump, delay and servo",
        plan(
            [
                waypoint(1, *HERE, -5),
                simple_item(2, 177, 2, 1, 3, 0, 0, 0, 0, 0),
                simple_item(3, 93, 2, 60, 0, 0, 0, 0, 0, 0),
                simple_item(4, 183, 2, 1, 1500, 0, 0, 0, 0, 0),
                {"type": "ComplexItem", "complexItemType": "CorridorScan"},
            ]
        ),
        waypoints=1,
        refused=tuple((f"item {n}", "cannot be flown") for n in (5, 2, 3, 4)),
        asks=("imports_rest",),
    ),
    Case(
        "too fast",
        plan([simple_item(1, 178, 2, 1, 12, -1, 0, 0, 0, 0), waypoint(2, *HERE, -5)]),
        waypoints=1,
        refused=(("item 1", "12 m/s is faster than the 5 m/s"),),
    ),
    Case("a survey of a line", plan([survey(5) | {"polygon": [[1, 2], [1, 2]]}]), "", 0,
         (("item 1", "a polygon needs three corners"),)),
    Case("deep", b'{"fileType": "Plan", "x": ' + b"[" * 150 + b"]" * 150 + b"}", "too deeply"),
    Case("too large", b" " * (BYTES_MAX + 1), "10.0 MB are more than the 10 taken"),
]  # fmt: skip
WPL = [
    Case("valid", wpl([flown(0, *HERE, 250.0), flown(3, *HERE, -5)]), "", 1, notes="is not flown"),
    Case(
        "blanks and comments",
        wpl([flown(0, *HERE, 0.0), flown(3, *HERE, -5)], "# x\n\n").replace(b"\t", b"  "),
        waypoints=1,
    ),
    Case("broken", wpl([flown(0, *HERE, 0.0)])[:-3] + b"\n", "line 2: has 11 columns"),
    Case("no number", wpl([flown(0, *HERE, 0.0)]).replace(b"42.762", b"north"), "line 2: could"),
    Case("huge", wpl([flown(0, *HERE, 0), *(flown(3, *at) for at in MANY)]), MANY_WORDS),
    Case("wrong version", b"QGC WPL 120\n", "'QGC WPL 120' is not taken"),
    Case("empty", wpl([flown(0, 0, 0, 0)]), "holds no waypoint"),
    Case(
        "above the water",
        wpl([flown(0, *HERE, 0), flown(3, *HERE, 5)]),
        refused=(("item 1", ABOVE),),
        asks=("turns_sign",),
    ),
    Case(
        "above the sea in a lake",
        wpl([flown(0, *HERE, 0), flown(5, *HERE, 250)]),
        refused=(("item 1", "mean sea level"),),
        asks=("surface_altitude_m",),
    ),
    Case(
        "nowhere", wpl([flown(0, *HERE, 0), flown(3, 0, 0, -5)]), refused=(("item 1", NO_PLACE),)
    ),
    Case(
        "NaN",
        wpl([flown(0, *HERE, 0), flown(3, *HERE, float("nan")), flown(3, float("nan"), 1, -5)]),
        refused=(("item 1", "no depth"), ("item 2", "no place")),
    ),
    Case(
        "after a return",
        wpl([flown(0, *HERE, 0), flown(3, *HERE, -5), flown(3, 0, 0, 0, 20), flown(3, *EAST, -5)]),
        waypoints=1,
        refused=(("item 3", "comes after a return"),),
    ),
]  # fmt: skip
KML = [
    Case("valid", kml_line((*HERE, -5), (*EAST, -5)), waypoints=2),
    Case("broken", kml_line((*HERE, -5), (*EAST, -5))[:-9], "no XML"),
    Case("text before", b"text\n" + kml_line((*HERE, -5), (*EAST, -5)), "line 1: no XML"),
    Case("huge", kml_line(*MANY), MANY_WORDS),
    Case("no KML", b"<gpx/>", "its root is <gpx>"),
    Case("self-crossing", kml(kml_ring(BOW_TIE)), refused=(("feature 1", CROSSES),)),
    Case("empty", kml(), "holds no waypoint"),
    Case(
        "above the water",
        kml_line((*HERE, 5), (*EAST, -5)),
        waypoints=1,
        refused=(("feature 1, point 1", ABOVE),),
        asks=("turns_sign",),
    ),
    Case(
        "clamped to the ground",
        kml_line((*HERE, -5), (*EAST, -5), mode=""),
        waypoints=2,
        asks=("default_depth_m",),
        notes="clamps them to the ground",
    ),
    Case(
        "nowhere",
        kml_line((0.0, 0.0, -5), (*EAST, -5)),
        waypoints=1,
        refused=(("feature 1, point 1", NO_PLACE),),
    ),
    Case("NaN", kml_line((float("nan"), 1.0, -5), (*EAST, -5)), "no longitude and latitude"),
    Case("entity bomb", kml(head=BOMB), "declares entities"),
    Case(
        "what loads and runs",
        kml(LINK, pin(HERE[1], HERE[0], "<script>alert(1)</script>".replace("<", "&lt;"))),
        notes="1 NetworkLink left out",
    ),
    Case("deep", b"<kml>" + b"<Folder>" * 200 + b"</Folder>" * 200 + b"</kml>", "in one another"),
]
KMZ = [
    Case("valid", zipped(doc_kml=kml_line((*HERE, -5), (*EAST, -5))), waypoints=2),
    Case("broken", zipped(doc_kml=kml())[:60], "no KMZ archive"),
    Case("broken KML", zipped(doc_kml=b"<kml>"), "no XML"),
    Case("huge", zipped(doc_kml=kml_line(*MANY)), MANY_WORDS),
    Case("no KML in it", zipped(image_png=b"x"), "holds no KML document"),
    Case("self-crossing", zipped(a_kml=kml(kml_ring(BOW_TIE))), refused=(("feature 1", CROSSES),)),
    Case("empty", zipped(doc_kml=kml()), "holds no waypoint"),
    Case("bomb", zipped(doc_kml=b" " * (9 << 20)), "times its size"),
    Case("large bomb", zipped(doc_kml=b" " * (11 << 20)), "unpacks to more than 10 MB"),
    Case("many", zipped(**{f"f{k}_kml": b"" for k in range(201)}), "entries are more than the 200"),
    Case("entity bomb", zipped(doc_kml=kml(head=BOMB)), "declares entities"),
    Case(
        "above the water",
        zipped(doc_kml=kml_line((*HERE, 5), (*EAST, 5))),
        refused=(("feature 1, point 1", ABOVE), ("feature 1, point 2", ABOVE)),
        asks=("turns_sign",),
    ),
]
OPEN = feature("Polygon", [[[b, a] for a, b in (HERE, EAST, (42.763, -84.376))]])
GEOJSON = [
    Case("valid", line((*HERE, -5), (*EAST, -5)), waypoints=2),
    Case("broken", line((*HERE, -5), (*EAST, -5))[:-9], "no JSON"),
    Case("no coordinates", line((*HERE, -5)).replace(b"42.762", b'"x"'), "feature 1: its coord"),
    Case("huge", line(*MANY), MANY_WORDS),
    Case("no GeoJSON", b'{"type": "Topology"}', "'Topology' is no geometry"),
    Case("a list", b"[1, 2]", "neither a plan nor GeoJSON"),
    Case(
        "self-crossing",
        geojson(feature("Polygon", [[[b, a] for a, b in [*BOW_TIE, BOW_TIE[0]]]])),
        refused=(("feature 1", CROSSES),),
    ),
    Case("open ring", geojson(OPEN), refused=(("feature 1", "does not close"),)),
    Case("empty", geojson(), "holds no waypoint"),
    Case(
        "above the water",
        line((*HERE, 5), (*EAST, -5)),
        waypoints=1,
        refused=(("feature 1, point 1", ABOVE),),
        asks=("turns_sign",),
    ),
    Case("no height", line(HERE, EAST), waypoints=2, asks=("default_depth_m",)),
    Case("its depth wins", line((*HERE, 900), (*EAST, 900), depth_m=4), waypoints=2),
    Case(
        "negative depth",
        line(HERE, EAST, depth_m=-5),
        refused=(("feature 1, point 1", ABOVE), ("feature 1, point 2", ABOVE)),
        asks=("turns_sign",),
    ),
    Case("nowhere", line((0, 0, -5), (*EAST, -5)), "", 1, (("feature 1, point 1", NO_PLACE),)),
    Case("NaN", line((float("nan"), 1, -5)), "NaN is no number of JSON"),
    Case("metres", line((4_735_000, 551_000, -5)), "no longitude and latitude"),
    Case("another reference system", geojson(
        feature("Point", [1, 2]), crs={"properties": {"name": "EPSG:32616"}}
    ), "crs: the file names the reference system"),
]  # fmt: skip
CSV = [
    Case("valid", csv("A,42.762,-84.377,5", "B,42.762,-84.376,0"), waypoints=2),
    Case(
        "degrees and minutes",
        csv(
            'A,"42 45.72 N, 84 22.62 W",5', 'B,"42° 45′ 43.2″ N, 084° 22′ 33.6″ W",5',  # noqa: RUF001
            head="name;position (deg);depth (m)".replace(";", ","),
        ),
        waypoints=2,
    ),
    Case("broken", csv('A,"42.762,-84.377,5'), "line 2: no CSV"),
    Case("too many cells", csv("A,1,2,3,4,5"), "line 2: has 6 cells, the header 4"),
    Case("no unit", csv(head="name,latitude_deg,longitude_deg,depth"), "'depth' names no unit"),
    Case("no place", csv(head="name,depth_m"), "needs the columns north_m and east_m"),
    Case("twice", csv(head="north_m,east_m,east_m"), "'east_m' stands there twice"),
    Case("huge", csv(*(f"A,{a},{b},5" for a, b, _ in MANY)), MANY_WORDS),
    Case("empty", csv(), "holds no waypoint"),
    Case("comments alone", b"# nothing\n\n", "holds no line"),
    Case(
        "above the water",
        csv("A,42.762,-84.377,-5", "B,42.762,-84.376,5"),
        waypoints=1,
        refused=(("line 2", ABOVE),),
        asks=("turns_sign",),
    ),
    Case("no depth", csv("A,42.762,-84.377,"), waypoints=1, asks=("default_depth_m",)),
    Case("nowhere", csv("A,0,0,5"), refused=(("line 2", NO_PLACE),)),
    Case(
        "NaN and commas",
        csv("A;nan;1;5", "B;42.762;-84.377;nan", "C;42.762;-84.377;1,5",
            head="name;latitude_deg;longitude_deg;depth_m"),
        refused=(("line 2", "is no latitude"), ("line 3", "no number"), ("line 4", "not a comma")),
    ),
    Case(
        "what is none",
        csv("fly,1,0,5,30,1,", "glide,5,0,5,30,1,", "glide,0,1,5,95,1,", "glide,0,1,5,30,9,",
            "glide,0,1,5,30,1,maybe",
            head="motion,shallow_m,north_m,deep_m,glide_angle_deg,speed_m_s,surfaces,east_m"),
        refused=tuple((f"line {n}", "") for n in range(2, 7)),
    ),
    Case("a stranger's column", csv("1,2,3,hm", head="north_m,east_m,depth_m,mood"), "", 1,
         notes="Columns that are not known are left out: mood"),
]  # fmt: skip
ENDINGS = {
    ".plan": PLAN, ".waypoints": WPL, ".kml": KML, ".kmz": KMZ, ".geojson": GEOJSON, ".csv": CSV,
}  # fmt: skip
CASES = [
    pytest.param(f"file{ending}", case, id=f"{ending[1:]} {case.name}")
    for ending, cases in ENDINGS.items()
    for case in cases
]


def read(name: str, content: bytes, **choices: object) -> PlanFileProposal:
    return read_plan_file(name, content, LAKE, ReadChoices.model_validate(choices))


@pytest.mark.parametrize(("name", "case"), CASES)
def test_a_file_is_read_as_it_is_meant_or_refused_in_words(name: str, case: Case):
    if case.error:
        with pytest.raises(ReadingError) as refusal:
            read(name, case.content)
        assert case.error in str(refusal.value)
        return
    found = read(name, case.content)
    content = found.document.content
    assert isinstance(content, Way)
    assert len(content.waypoints) == case.waypoints
    assert [one.place for one in found.refused] == [place for place, _ in case.refused]
    for one, (_, reason) in zip(found.refused, case.refused, strict=True):
        assert reason in one.reason
    asked = {question.key for question in found.needs}
    assert set(case.asks) <= asked
    assert ("imports_rest" in asked) == bool(case.refused)
    assert case.notes in " ".join(found.notes)


def test_there_are_ten_files_of_each_format():
    assert all(len(cases) >= 10 for cases in ENDINGS.values())


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.plan", plan([waypoint(1, *HERE, 5), waypoint(2, *EAST, 3)])),
        ("a.txt", wpl([flown(0, *HERE, 0), flown(3, *HERE, 5), flown(0, *EAST, 3)])),
        ("a.kml", kml_line((*HERE, 5), (*EAST, 3))),
        ("a.geojson", line((*HERE, 5), (*EAST, 3))),
        ("a.csv", csv("A,42.762,-84.377,-5", "B,42.762,-84.376,-3")),
    ],
)
def test_the_sign_is_turned_for_the_whole_file(name: str, content: bytes):
    found = read(name, content, turns_sign=True)
    assert found.refused == ()
    assert isinstance(found.document.content, Way)
    usual = found.document.manner
    assert [one.manner(usual).deep_m for one in found.document.content.waypoints] == [5.0, 3.0]


def test_signs_are_never_mixed():
    found = read("a.plan", plan([waypoint(1, *HERE, 5), waypoint(2, *EAST, -3)]), turns_sign=True)
    assert [one.place for one in found.refused] == ["item 2"]
    assert "3.0 m above the water" in found.refused[0].reason


def test_an_altitude_above_the_sea_counts_from_the_surface_of_the_lake():
    content = plan([simple_item(1, 16, 0, 0, 0, 0, None, *HERE, 250.0)])
    found = read("a.plan", content, surface_altitude_m=257.5)
    assert found.document.manner.deep_m == pytest.approx(7.5)
    told = LAKE.model_copy(update={"surface_altitude_m": 256.0})
    assert read_plan_file("a.plan", content, told, ReadChoices()).document.manner.deep_m == 6.0


def test_places_without_a_depth_get_the_one_that_is_asked_for():
    open_ = read("a.geojson", line(HERE, EAST))
    assert not open_.is_ready
    told = read("a.geojson", line(HERE, EAST), default_depth_m=7.0)
    assert told.is_ready
    assert told.document.manner.deep_m == 7.0
    swum = read("a.geojson", line(HERE, EAST), default_depth_m=0.0)
    assert swum.document.manner.motion == "swim"


def test_speeds_hold_for_the_motion_that_they_are_of():
    items = [
        simple_item(1, 178, 2, 1, 0.5, -1, 0, 0, 0, 0),
        simple_item(2, 178, 2, 3, 0.2, -1, 0, 0, 0, 0),
        waypoint(3, *HERE, -5),
        waypoint(4, *EAST, 0),
        simple_item(5, 178, 2, 1, -2, -1, 0, 0, 0, 0),
        waypoint(6, *HERE, 0),
    ]
    content = read("a.plan", plan(items)).document.content
    assert isinstance(content, Way)
    assert [one.speed_m_s for one in content.waypoints] == [0.2, 0.5, None]


def read_or_refused(name: str, content: bytes) -> str:
    """Return the format of a file, or why it is refused."""
    try:
        return read(name, content).format
    except ReadingError as error:
        return str(error)


BROKEN_BYTES = st.sampled_from(
    [PLAN[0].content, WPL[0].content, KML[0].content, KMZ[0].content, GEOJSON[0].content,
     CSV[0].content, plan([survey(5)], [fence(BOW_TIE)])]
)  # fmt: skip


@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(BROKEN_BYTES, st.data())
def test_a_file_with_wrong_bytes_is_read_or_refused_but_never_fails(content: bytes, data):
    damaged = bytearray(content)
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(damaged) - 1))
        match data.draw(st.sampled_from(["change", "cut", "double"])):
            case "change":
                damaged[at] = data.draw(st.integers(0, 255))
            case "cut":
                del damaged[at : at + data.draw(st.integers(1, 40))]
            case _:
                damaged[at:at] = damaged[at : at + data.draw(st.integers(1, 40))]
        if not damaged:
            return
    name = data.draw(st.sampled_from(["a.plan", "a.txt", "a.kml", "a.kmz", "a.geojson", "a.csv"]))
    assert read_or_refused(name, bytes(damaged))


def _leaves(value: object, path: tuple[object, ...] = ()) -> list[tuple[object, ...]]:
    inner = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    return [path, *(leaf for key, each in inner for leaf in _leaves(each, (*path, key)))][1:] or [
        path
    ]


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=5,
)


@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    st.sampled_from(
        [
            plan([survey(5), waypoint(2, *HERE, -5)], [fence(BOW_TIE)], home=(1, 2, 3)),
            GEOJSON[0].content,
        ]
    ),
    JSON,
    st.data(),
)
def test_json_of_another_shape_is_read_or_refused_but_never_fails(content: bytes, other, data):
    document = json.loads(content)
    path = data.draw(st.sampled_from(_leaves(document)))
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = other
    assert read_or_refused("a.plan", json.dumps(document).encode())
