"""How bad the water is for sound, from the command line to the modems."""

import pytest

from server.cli import demo_verb
from server.cli.main import main
from simulator import process
from simulator.fleet import GRACE_1, MINI_1

TROUBLE = ("--acoustic-loss", "0.3", "--acoustic-outliers", "0.1")


def test_simulation_makes_the_water_as_bad_as_told(tmp_path, monkeypatch):
    taken = []
    monkeypatch.setattr(process, "run", lambda settings, *_, **__: taken.append(settings))
    assert main(("simulate", "--data", str(tmp_path), *TROUBLE)) == 0
    for robot in (MINI_1, GRACE_1):
        water, calm = taken[0].acoustics(robot), robot.acoustics
        assert (water.loss, water.outliers, water.garbling) == (0.3, 0.1, 0.0)
        assert water.travel_time_std_s == calm.travel_time_std_s
        assert (water.range_m, water.echo_s) == (calm.range_m, calm.echo_s)


def test_water_is_good_unless_told_otherwise(tmp_path, monkeypatch):
    taken = []
    monkeypatch.setattr(process, "run", lambda settings, *_, **__: taken.append(settings))
    assert main(("simulate", "--data", str(tmp_path))) == 0
    assert taken[0].acoustics(MINI_1) == MINI_1.acoustics


def test_demo_hands_the_trouble_on_to_its_simulation(monkeypatch):
    children = []

    class Told:
        def __init__(self, told, *_) -> None:
            children.extend(told)

        async def run(self) -> int:
            return 0

    monkeypatch.setattr(demo_verb, "Supervisor", Told)
    assert main(("demo", "--no-browser", *TROUBLE)) == 0
    simulator = children[0].command
    first = simulator.index("--acoustic-loss")
    assert simulator[first : first + len(TROUBLE)] == TROUBLE


@pytest.mark.parametrize("verb", ["demo", "simulate"])
@pytest.mark.parametrize("part", ["-0.1", "0.95", "half"])
def test_part_that_is_none_is_refused_by_name(verb, part, capsys):
    with pytest.raises(SystemExit) as ended:
        main((verb, f"--acoustic-loss={part}"))
    assert ended.value.code == 2
    assert "--acoustic-loss" in capsys.readouterr().err
