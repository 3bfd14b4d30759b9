"""``grace water`` on a data folder that no station uses."""

import pytest

from server.cli.main import main
from tests.server.water.foreign import BOW_TIE, bay, bowl, feature, geojson, geotiff


@pytest.fixture
def files(tmp_path):
    shape, depths = tmp_path / "bay.geojson", tmp_path / "bay.tif"
    shape.write_bytes(geojson(feature("Polygon", [bay(400, wobble=0.02)], name="Bay")))
    geotiff(depths, bowl())
    return [str(shape), str(depths)]


def test_a_water_is_added_and_listed(tmp_path, files, capsys):
    folder = ["--data", str(tmp_path)]
    added = main(["water", "add", *files, "--name", "Our bay", "--datum", "low", "--yes", *folder])
    said = capsys.readouterr()
    assert added == 0, said.err
    assert "feature 1 'Bay': outline, polygon of 400 corners" in said.out
    assert "100 x 100 depths" in said.out
    assert said.out.endswith("Added our-bay.\n")
    assert main(["water", "list", *folder]) == 0
    listed = capsys.readouterr().out
    assert "our-bay: Our bay (no robot)" in listed
    assert "practice-lake: Practice lake (grace-1)" in listed
    assert len(list((tmp_path / "water_charts").iterdir())) == 1


def test_nothing_is_kept_that_nobody_confirms_or_that_is_broken(tmp_path, files, capsys):
    folder = ["--data", str(tmp_path)]
    assert main(["water", "add", files[0], "--name", "X", "--depth-max", "9", *folder]) == 1
    assert "say --yes" in capsys.readouterr().err
    broken = tmp_path / "broken.geojson"
    broken.write_bytes(geojson(feature("Polygon", [BOW_TIE])))
    assert main(["water", "add", str(broken), "--name", "X", "--yes", *folder]) == 1
    assert "feature 1: crosses itself" in capsys.readouterr().err
    main(["water", "list", *folder])
    assert "X" not in capsys.readouterr().out
