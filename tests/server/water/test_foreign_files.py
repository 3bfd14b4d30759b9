"""Ten files of each kind as others write them: read right, or refused by feature or line."""

import io
import json
import zipfile

import netCDF4
import numpy as np
import pytest

from server.water.proposal import load_reading
from server.water.reading_task import ReadingOrder, run
from tests.server.water.foreign import (
    BOW_TIE,
    CENTRE,
    FIJI,
    UTM,
    bay,
    bowl,
    feature,
    geojson,
    geotiff,
    gpx,
    kml,
    netcdf,
    pin,
    placemark,
    square,
    track,
)

HUGE = bay(20_500)


def read(tmp_path, name, content, crs=""):
    """Return what reading a file came to; a refusal keeps nothing."""
    path = tmp_path / "upload"
    if callable(content):
        content(path)
    else:
        path.write_bytes(content)
    folder = tmp_path / "proposals"
    order = ReadingOrder(path, name, "", crs, folder, "abcdef0123456789")
    found = run(order, lambda _: None, lambda: False)
    kept = [each.name for each in folder.iterdir()] if folder.exists() else []
    assert kept == ([] if "errors" in found else ["abcdef0123456789.npz"])
    return found


def check(found, wanted):
    """Hold an outcome against ``(place, part of the reason)``, or a proposal's own figures."""
    if isinstance(wanted, tuple):
        assert "errors" in found, found
        fault = found["errors"][0]
        assert fault["place"] == wanted[0], fault
        assert wanted[1] in fault["reason"], fault
        return
    assert "errors" not in found, found
    for key, value in wanted.items():
        assert found[key] == value, key
    assert found["extent"]["south"] == pytest.approx(CENTRE[0], abs=0.3)
    assert found["extent"]["west"] == pytest.approx(CENTRE[1], abs=0.3)


def zipped(**entries):
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name.replace("__", "/").replace("_", "."), content)
    return held.getvalue()


GEOJSON = {
    "valid": (geojson(feature("Polygon", [bay(300)], name="Bay")), {"features_total": 1}),
    "with islands and places": (
        geojson(
            feature("Polygon", [bay(), square()], name="Bay"),
            feature("Polygon", [square(0.02)], name="Gull island"),
            feature("MultiPoint", [[-85.0, 44.0], [-85.0, 44.01]], name="Buoys"),
        ),
        {"features_total": 4},
    ),
    "a bare geometry": (
        json.dumps({"type": "Polygon", "coordinates": [bay()]}).encode(),
        {"kind": "shapes"},
    ),
    "broken": (geojson(feature("Polygon", [bay()]))[:-20], ("line 1", "no JSON")),
    "huge": (
        geojson(feature("Point", CENTRE[::-1]), feature("Polygon", [HUGE])),
        ("feature 2", "20000 are the most"),
    ),
    "wrong projection": (
        geojson(feature("Point", CENTRE[::-1]), feature("Polygon", [UTM])),
        ("feature 2", "no longitude and latitude"),
    ),
    "self-crossing": (
        geojson(feature("Polygon", [bay()]), feature("Polygon", [BOW_TIE])),
        ("feature 2", "the side after corner 1 meets the side after corner 3"),
    ),
    "empty": (b"", ("", "empty")),
    "over the antimeridian": (
        geojson(feature("Polygon", [FIJI])),
        ("feature 1", "antimeridian"),
    ),
    "active": (
        geojson(feature("Polygon", [bay()], name="<script>alert(1)</script>")),
        ("feature 1", "active content"),
    ),
    "another reference system": (
        geojson(
            feature("Polygon", [bay()]),
            crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32616"}},
        ),
        ("crs", "EPSG::32616"),
    ),
    "no polygon": (geojson(feature("LineString", bay())), ("", "no polygon and no point")),
}

KML = {
    "valid": (kml(placemark(bay())), {"format": "KML", "features_total": 1}),
    "with holes and pins": (
        kml(placemark(bay(), holes=[square()]), pin(-85.0, 44.01)),
        {"features_total": 2},
    ),
    "broken": (kml(placemark(bay()))[:-30], ("line 3", "no XML")),
    "broken coordinates": (
        kml(pin(-85.0, 44.0), pin("west", 44.0)),
        ("feature 2", "no numbers"),
    ),
    "huge": (kml(placemark(HUGE)), ("feature 1", "20000 are the most")),
    "wrong projection": (kml(placemark(UTM)), ("feature 1", "no longitude and latitude")),
    "self-crossing": (
        kml(placemark(bay()), placemark(BOW_TIE)),
        ("feature 2", "the side after corner 1 meets the side after corner 3"),
    ),
    "empty": (kml(), ("", "no polygon and no point")),
    "a link": (
        kml("<NetworkLink><Link><href>http://127.0.0.1/x.kml</href></Link></NetworkLink>"),
        ("<NetworkLink>", "loads or runs something else"),
    ),
    "an entity bomb": (
        kml(placemark(bay(), name="&a;"), head='<!DOCTYPE k [<!ENTITY a "aaaaaaaa">]>'),
        ("", "entities or a document type"),
    ),
    "a script": (
        kml(placemark(bay(), more="<description>&lt;SCRIPT&gt;</description>")),
        ("feature 1", "active content"),
    ),
}

KMZ = {
    "valid": (zipped(doc_kml=kml(placemark(bay()))), {"format": "KMZ"}),
    "with pictures": (
        zipped(doc_kml=kml(placemark(bay())), files__a_png=b"\x89PNG"),
        {"features_total": 1},
    ),
    "under another name": (zipped(places_kml=kml(placemark(bay()))), {"format": "KMZ"}),
    "broken": (zipped(doc_kml=kml(placemark(bay())))[:-40], ("", "no KMZ archive")),
    "huge": (zipped(doc_kml=kml(placemark(HUGE))), ("feature 1", "20000 are the most")),
    "a bomb": (
        zipped(doc_kml=kml(placemark(bay())), bomb_kml=b"0" * (60 << 20)),
        ("bomb.kml", "200 times its size"),
    ),
    "too much": (
        zipped(a_kml=kml(placemark(bay())), b_bin=b"\0" * (65 << 20)),
        ("", "more than 64 MB"),
    ),
    "too many": (
        zipped(**{f"f{n}_txt": b"x" for n in range(300)}),
        ("", "300 entries"),
    ),
    "wrong projection": (
        zipped(doc_kml=kml(placemark(UTM))),
        ("feature 1", "no longitude and latitude"),
    ),
    "self-crossing": (zipped(doc_kml=kml(placemark(BOW_TIE))), ("feature 1", "crosses itself")),
    "empty": (zipped(), ("", "no KML document")),
}

GPX = {
    "valid": (gpx(track(bay())), {"format": "GPX"}),
    "waypoints": (
        gpx('<wpt lat="44.0" lon="-85.0"><name>Dock</name><type>dock</type></wpt>', track(bay())),
        {"features_total": 2},
    ),
    "a route": (gpx(track(bay()).replace("trkpt", "rtept").replace("trk", "rte")), {}),
    "broken": (gpx(track(bay()))[:-10], ("line 3", "no XML")),
    "no place": (gpx('<wpt lat="44.0"/>'), ("feature 1", "no lat and lon")),
    "huge": (gpx(track(HUGE)), ("feature 1", "20000 are the most")),
    "wrong projection": (gpx(track(UTM)), ("feature 1", "no longitude and latitude")),
    "self-crossing": (gpx(track(BOW_TIE)), ("feature 1", "crosses itself")),
    "empty": (gpx(), ("", "no polygon and no point")),
    "an open way": (gpx(track(bay()[:12])), ("", "no polygon and no point")),
    "no GPX": (kml(placemark(bay())), ("", "no GPX")),
}


def tiff(values=None, **options):
    return lambda path: geotiff(path, bowl() if values is None else values, **options)


def unknown_middle():
    values = bowl()
    values[:, 40:60] = np.nan
    return values


GEOTIFF = {
    "valid heights": (tiff(), {"datum": "World Geodetic System 1984"}),
    "depths": (tiff(-bowl()), {"kind": "depths"}),
    "in a projection": (
        tiff(crs="EPSG:32616", west=651_000.0, north=4_882_000.0, step=150.0),
        {"crs": "WGS 84 / UTM zone 16N (EPSG:32616)"},
    ),
    "in another datum": (tiff(crs="EPSG:4267"), {"datum": "North American Datum 1927"}),
    "with holes": (tiff(unknown_middle()), {"kind": "depths"}),
    "broken": (b"II*\0" + bytes(200), ("", "no GeoTIFF that can be read")),
    "huge": (
        tiff(np.zeros((1, 100_001), np.int16) - 5, step=1e-6),
        ("", "more than 100000 lines"),
    ),
    "wrong projection": (tiff(crs=None), ("crs", "names no coordinate reference system")),
    "whole earth": (
        tiff(bowl(180, 360), west=-180.0, north=90.0, step=1.0),
        ("", "on one side of the antimeridian"),
    ),
    "empty": (b"", ("", "no GeoTIFF that can be read")),
    "nothing known": (tiff(np.full((20, 20), np.nan, np.float32)), ("", "every point is empty")),
}

LAT, LON = np.linspace(43.9, 44.1, 100), np.linspace(-85.1, -84.9, 120)


def nc(values=None, lat=LAT, lon=LON, **options):
    return lambda path: netcdf(
        path, bowl(100, 120) if values is None else values, lat, lon, **options
    )


def two_grids(path):
    netcdf(path, bowl(100, 120), LAT, LON)
    with netCDF4.Dataset(path, "a") as data:
        data.createVariable("depth", "f4", ("lat", "lon"))[:] = bowl(100, 120)


def no_grid(path):
    with netCDF4.Dataset(path, "w") as data:
        data.createDimension("time", 3)
        data.createVariable("time", "f8", ("time",))[:] = [1, 2, 3]


NETCDF = {
    "valid": (nc(), {"kind": "depths"}),
    "north first": (nc(bowl(100, 120)[::-1], lat=LAT[::-1]), {"kind": "depths"}),
    "columns first": (
        lambda path: netcdf(path, bowl(120, 100), LON, LAT, axes=("lon", "lat")),
        {"kind": "depths"},
    ),
    "depths down": (nc(-bowl(100, 120), name="depth", positive="down"), {"kind": "depths"}),
    "longitudes to 360": (nc(lon=LON + 360.0), {"kind": "depths"}),
    "broken": (b"\x89HDF\r\n\x1a\n" + bytes(64), ("", "no NetCDF file")),
    "huge": (
        nc(bowl(2100, 2300), np.linspace(43.9, 44.1, 2100), np.linspace(-85.1, -84.9, 2300)),
        {},
    ),
    "wrong projection": (
        lambda path: netcdf(path, bowl(), np.arange(100.0), np.arange(100.0), axes=("y", "x")),
        ("crs", "give the crs"),
    ),
    "several grids": (two_grids, ("", "several grids (elevation, depth)")),
    "feet": (nc(units="feet"), ("elevation", "in feet, not in m")),
    "empty": (b"", ("", "empty")),
    "no grid": (no_grid, ("", "no grid over latitude and longitude")),
}


def xyz(rows=40, columns=50, head="", form="{:.6f} {:.6f} {:.2f}\n", scale=1.0):
    heights = bowl(rows, columns) * scale
    lines = [
        form.format(x, y, heights[i, j])
        for i, y in enumerate(np.linspace(43.9, 44.1, rows))
        for j, x in enumerate(np.linspace(-85.1, -84.9, columns))
    ]
    return (head + "".join(lines)).encode()


def scattered():
    generator = np.random.default_rng(4)
    x, y = generator.uniform(-85.1, -84.9, 3000), generator.uniform(43.9, 44.1, 3000)
    return "".join(
        f"{a:.7f},{b:.7f},{5 + 10 * (a + 85):.2f}\n" for a, b in zip(x, y, strict=True)
    ).encode()


XYZ = {
    "valid": (xyz(), {"kind": "depths"}),
    "with a head and commas": (
        xyz(head="lon,lat,depth\n", form="{:.6f},{:.6f},{:.2f}\n", scale=-1.0),
        {"kind": "depths"},
    ),
    "with remarks": (xyz(head="# survey of 2019\n# m\n"), {"kind": "depths"}),
    "scattered": (scattered(), {"kind": "depths"}),
    "broken": (xyz() + b"-85.0 44.0 deep\n", ("line 2001", "needs x, y and depth")),
    "too deep": (xyz() + b"-85.0 44.0 -20000\n", ("line 2001", "no depth on earth")),
    "huge": (b"\0" * 20_000, ("line 1", "is no text")),
    "wrong projection": (
        b"659000 4873000 -3\n661000 4873000 -4\n659000 4875000 -3\n661000 4875000 -2\n",
        ("crs", "no longitude and latitude"),
    ),
    "on one line": (b"-85 44 1\n-85 44.1 1\n-85 44.2 1\n-85 44.3 1\n", ("", "on one line")),
    "empty": (b"", ("", "four points at least")),
    "no text": (b"\xff\xfe-\0008\0", ("line 1", "is no text")),
}


@pytest.mark.parametrize(("content", "wanted"), GEOJSON.values(), ids=GEOJSON.keys())
def test_geojson(tmp_path, content, wanted):
    check(read(tmp_path, "bay.geojson", content), wanted)


@pytest.mark.parametrize(("content", "wanted"), KML.values(), ids=KML.keys())
def test_kml(tmp_path, content, wanted):
    check(read(tmp_path, "bay.kml", content), wanted)


@pytest.mark.parametrize(("content", "wanted"), KMZ.values(), ids=KMZ.keys())
def test_kmz(tmp_path, content, wanted):
    check(read(tmp_path, "bay.kmz", content), wanted)


@pytest.mark.parametrize(("content", "wanted"), GPX.values(), ids=GPX.keys())
def test_gpx(tmp_path, content, wanted):
    check(read(tmp_path, "bay.gpx", content), wanted)


@pytest.mark.parametrize(("content", "wanted"), GEOTIFF.values(), ids=GEOTIFF.keys())
def test_geotiff(tmp_path, content, wanted):
    check(read(tmp_path, "bay.tif", content), wanted)


@pytest.mark.parametrize(("content", "wanted"), NETCDF.values(), ids=NETCDF.keys())
def test_netcdf(tmp_path, content, wanted):
    check(read(tmp_path, "gebco.nc", content), wanted)


@pytest.mark.parametrize(("content", "wanted"), XYZ.values(), ids=XYZ.keys())
def test_xyz(tmp_path, content, wanted):
    check(read(tmp_path, "bay.xyz", content), wanted)


@pytest.mark.parametrize(
    ("name", "content", "are_heights"),
    [
        ("a.tif", tiff(), True),
        ("a.tif", tiff(-bowl()), False),
        ("a.nc", nc(), True),
        ("a.nc", nc(-bowl(100, 120), name="depth"), False),
        ("a.xyz", xyz(), True),
        ("a.xyz", xyz(scale=-1.0), False),
    ],
)
def test_the_sign_of_depths_is_told_and_the_deepest_is_the_same(
    tmp_path, name, content, are_heights
):
    depths = read(tmp_path, name, content)["depths"]
    assert depths["are_heights"] == are_heights
    assert depths["deepest_m"] == pytest.approx(30.0, abs=0.3)


def test_a_projection_that_is_named_is_converted(tmp_path):
    found = read(tmp_path, "utm.geojson", geojson(feature("Polygon", [UTM])), "EPSG:32616")
    assert found["crs"].startswith("WGS 84 / UTM zone 16N")
    assert found["extent"]["south"] == pytest.approx(44.0, abs=0.05)
    (tmp_path / "other").mkdir()
    refused = read(tmp_path / "other", "utm.geojson", geojson(), "EPSG:99999")
    check(refused, ("crs", "no reference system"))


def test_a_large_grid_is_thinned_to_its_shallowest(tmp_path):
    rows = np.full((4100, 60), -20.0, np.float32)
    rows[1001, 30] = -1.0  # a rock
    found = read(tmp_path, "a.tif", tiff(rows, step=1e-4))
    assert found["depths"]["rows"] <= 2000
    assert found["depths"]["shallowest_m"] == 1.0
    kept = load_reading(tmp_path / "proposals", "abcdef0123456789")
    assert kept.depths.values.max() == -1.0
