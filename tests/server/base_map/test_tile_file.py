"""Files of tiles are read by place, and refused in words where they are not what they say."""

import gzip
import struct

import pytest
from pmtiles.tile import Compression, TileType

from server.base_map import mbtiles_file
from server.base_map.base_maps import open_tile_file
from server.base_map.tile_image import SIDE_PX_MAX, TILE_BYTES_MAX, TileFileError, picture
from tests.server.base_map.tile_files import (
    INDEX,
    METADATA,
    TABLES,
    X,
    Y,
    Z,
    jpeg,
    mbtiles,
    pmtiles,
    png,
    webp,
)

SVG = b"<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>"


@pytest.fixture
def opened():
    files = []

    def open_(path):
        files.append(open_tile_file(path))
        return files[-1]

    yield open_
    for file in files:
        file.close()


def written(tmp_path, data):
    path = tmp_path / "chart.pmtiles"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("kind", ["pmtiles", "mbtiles"])
def test_a_file_tells_what_it_holds_and_gives_its_tiles(tmp_path, opened, kind):
    if kind == "pmtiles":
        file = opened(written(tmp_path, pmtiles()))
        assert (file.facts.title, file.facts.attribution) == (METADATA["name"], "Survey & Sons")
    else:
        file = opened(mbtiles(tmp_path / "chart.mbtiles"))
        assert file.facts.title == "Harbour"
    facts = file.facts
    edges = (facts.west_deg, facts.south_deg, facts.east_deg, facts.north_deg)
    assert edges == pytest.approx((-84.6, 42.6, -84.2, 42.9))
    assert (facts.max_zoom, facts.media_type) == (Z, "image/png")
    assert file.tile(Z, X, Y) == png()
    assert file.tile(Z, X + 1, Y) is None
    assert file.tile(0, 0, 0) is None


def test_a_tile_is_found_behind_directories_of_directories(tmp_path, opened):
    tiles = {(9, x, y): png(1, note=b"%d %d" % (x, y)) for x in range(150) for y in range(150)}
    file = opened(written(tmp_path, pmtiles(tiles)))
    for place in ((9, 0, 0), (9, 149, 149), (9, 77, 3)):
        assert file.tile(*place) == tiles[place]
    assert file.tile(9, 150, 0) is None


def test_mbtiles_without_bounds_reach_as_far_as_their_coarsest_tiles(tmp_path, opened):
    path = mbtiles(tmp_path / "chart.mbtiles", {(1, 0, 0): png()}, {"name": "World"})
    facts = opened(path).facts
    assert (facts.min_zoom, facts.max_zoom) == (1, 1)
    edges = (facts.west_deg, facts.south_deg, facts.east_deg, facts.north_deg)
    assert edges == pytest.approx((-180.0, 0.0, 0.0, 85.0511), abs=1e-4)


def test_tiles_may_stand_in_a_view_as_some_programs_write_them(tmp_path, opened):
    statements = (
        TABLES[0],
        "CREATE TABLE map (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_id)",
        "CREATE TABLE images (tile_id TEXT PRIMARY KEY, tile_data BLOB)",
        "CREATE UNIQUE INDEX map_index ON map (zoom_level, tile_column, tile_row)",
        "CREATE VIEW tiles AS SELECT zoom_level, tile_column, tile_row, tile_data FROM map "
        "JOIN images ON images.tile_id = map.tile_id",
        f"INSERT INTO map VALUES ({Z}, {X}, {2**Z - 1 - Y}, 'a')",
        f"INSERT INTO images VALUES ('a', x'{png().hex()}')",
    )
    assert opened(mbtiles(tmp_path / "a.mbtiles", statements=statements)).tile(Z, X, Y) == png()


def test_a_trigger_of_a_file_never_runs_and_nothing_is_written(tmp_path, opened):
    trigger = "CREATE TRIGGER t AFTER INSERT ON tiles BEGIN DELETE FROM metadata; END"
    path = mbtiles(tmp_path / "a.mbtiles", statements=(*TABLES, INDEX))
    before = mbtiles(tmp_path / "b.mbtiles", statements=(*TABLES, INDEX, trigger)).read_bytes()
    assert opened(path).tile(Z, X, Y) == png()
    file = opened(tmp_path / "b.mbtiles")
    with pytest.raises(TileFileError):
        file._rows("INSERT INTO tiles VALUES (0, 0, 0, x'00')")
    assert (tmp_path / "b.mbtiles").read_bytes() == before
    assert not list(tmp_path.glob("*.mbtiles-*"))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "neither PMTiles nor MBTiles"),
        (b"\x89PNG" + bytes(300), "neither PMTiles nor MBTiles"),
        (b"PMTiles\x03", "cut short"),
        (b"PM\x02\x00" + bytes(300), "version 1 or 2"),
        (b"PMTiles\x04" + pmtiles()[8:], "version 4; version 3 is read"),
        (pmtiles()[:-1], "cut short"),
        (pmtiles(header={"tile_type": TileType.MVT}), "MVT, not pictures"),
        (pmtiles(header={"tile_compression": Compression.ZSTD}), "something else than gzip"),
        (pmtiles(header={"max_lat_e7": 420000000}), "its extent is"),
        (pmtiles()[:100] + bytes([30, 31]) + pmtiles()[102:], "its zooms are 30 to 31"),
        (pmtiles({(Z, X, Y): SVG}), "SVG or HTML"),
        (pmtiles({(Z, X, Y): b"\xef\xbb\xbf<html>"}), "SVG or HTML"),
        (pmtiles({(Z, X, Y): bytes(40)}), "no PNG, JPEG or WebP"),
        (pmtiles({(Z, X, Y): png(note=b"x" * TILE_BYTES_MAX)}), "at most 1048576 are taken"),
        (pmtiles({(Z, X, Y): gzip.compress(bytes(2**24))}), "unpacks to more than 1048576"),
    ],
)
def test_what_is_no_sound_pmtiles_is_refused_in_words(tmp_path, data, words):
    with pytest.raises(TileFileError, match=words):
        open_tile_file(written(tmp_path, data))


@pytest.mark.parametrize("part", ["root", "metadata"])
def test_a_directory_that_unpacks_without_end_is_refused(tmp_path, part):
    data = bytearray(pmtiles())
    bomb = gzip.compress(bytes(2**25))
    at = {"root": 8, "metadata": 24}[part]
    struct.pack_into("<QQ", data, at, len(data), len(bomb))
    with pytest.raises(TileFileError, match="unpacks to more than"):
        open_tile_file(written(tmp_path, bytes(data) + bomb))


def test_directories_that_lead_in_a_circle_are_left(tmp_path):
    data = bytearray(pmtiles())
    # One entry with no run: it points to itself, offset 0 among the leaves.
    loop = gzip.compress(bytes([1, 0, 0, 40, 1]))
    struct.pack_into("<QQ", data, 8, len(data), len(loop))
    struct.pack_into("<QQ", data, 40, len(data), len(loop))
    packed = bytes(data) + loop + bytes(40)
    with pytest.raises(TileFileError):
        open_tile_file(written(tmp_path, packed))


@pytest.mark.parametrize(
    ("statements", "words"),
    [
        (("CREATE TABLE something (a)",), "no such table: tiles"),
        (TABLES, "no index"),
        ((TABLES[0], "CREATE TABLE tiles (a, b)"), "no such column"),
        (
            (
                TABLES[0],
                "CREATE VIEW tiles AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 "
                "FROM c) SELECT 0 AS zoom_level, n AS tile_column, 0 AS tile_row, x'00' AS "
                "tile_data FROM c WHERE n < 0",
            ),
            "no index",
        ),
        (
            (
                TABLES[0],
                "CREATE VIEW tiles AS SELECT 0 AS zoom_level, 0 AS tile_column, 0 AS tile_row, "
                "readfile('x') AS tile_data",
            ),
            "cannot be read as MBTiles",
        ),
        (
            (
                TABLES[0],
                "CREATE VIEW tiles AS SELECT 0 AS zoom_level, 0 AS tile_column, 0 AS tile_row, "
                "randomblob(1000000000) AS tile_data",
            ),
            "cannot be read as MBTiles",
        ),
    ],
)
def test_a_database_of_another_form_is_refused_in_words(tmp_path, statements, words):
    path = mbtiles(tmp_path / "a.mbtiles", statements=statements)
    with pytest.raises(TileFileError, match=words):
        open_tile_file(path)


def test_a_view_without_end_is_broken_off(tmp_path, monkeypatch):
    monkeypatch.setattr(mbtiles_file, "QUERY_MAX_S", 0.05)
    endless = (
        "CREATE VIEW metadata AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c) "
        "SELECT 'name' AS name, 'x' AS value FROM c WHERE n < 0"
    )
    path = mbtiles(tmp_path / "a.mbtiles", statements=(endless, TABLES[1], INDEX))
    with pytest.raises(TileFileError, match="interrupted"):
        open_tile_file(path)


@pytest.mark.parametrize(
    ("tiles", "metadata", "words"),
    [
        ({}, None, "holds no tiles"),
        ({(Z, X, Y): SVG}, None, "SVG or HTML"),
        (None, {"format": "pbf"}, "vectors"),
        (None, {"bounds": "1,2,nan,4", "minzoom": "1", "maxzoom": "2"}, "its extent is"),
        ({(Z, X, Y): png() + bytes(3 * 2**20)}, None, "longer than"),
    ],
)
def test_unsound_mbtiles_are_refused_in_words(tmp_path, tiles, metadata, words):
    with pytest.raises(TileFileError, match=words):
        open_tile_file(mbtiles(tmp_path / "a.mbtiles", tiles, metadata))


def test_a_database_that_is_cut_short_is_refused(tmp_path):
    path = mbtiles(tmp_path / "a.mbtiles", {(Z, X, Y): png(note=bytes(50_000))})
    path.write_bytes(path.read_bytes()[:9000])
    with pytest.raises(TileFileError, match="cannot be read as MBTiles"):
        open_tile_file(path)


@pytest.mark.parametrize("make", [jpeg, webp])
def test_a_picture_of_any_known_kind_is_measured(make):
    kind, data = picture(make(512, 512))
    assert kind == f"image/{make.__name__}"
    assert data == make(512, 512)
    with pytest.raises(TileFileError, match="at most 1024 a side"):
        picture(make(SIDE_PX_MAX + 1, 4))


def test_a_packed_picture_is_unpacked_and_a_vast_one_refused():
    assert picture(gzip.compress(png())) == ("image/png", png())
    with pytest.raises(TileFileError, match="60000 x 60000 pixels"):
        picture(png(60_000))
    for data in (png()[:18], jpeg()[:12], webp()[:15]):
        with pytest.raises(TileFileError):
            picture(data)
