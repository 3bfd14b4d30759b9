"""The product as one file: built whole or refused, and run where nothing else of it is."""

import html
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import httpx
import pytest

from tests.e2e.demo import ROOT, Demo

pytestmark = [pytest.mark.process, pytest.mark.timeout(1200)]
PACKAGES = ("autonomy", "db", "onboard", "reproduction", "robot_link", "server", "simulator")
MADE = ("webui/dist/index.html", "webui/dist/help/index.html",
        "robot_link/mavlink/dialect/grace.py")  # fmt: skip


def pip(*words, python=sys.executable):
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", str(python),
         *map(str, words)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def build(tree, into):
    return pip("wheel", "--no-deps", "--no-index", "--no-build-isolation", "-w", into, tree)


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """What is needed to build, as in the repository; the build leaves its traces in the copy."""
    tree = tmp_path_factory.mktemp("tree")
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    for name in (*PACKAGES, "webui"):
        ignored = shutil.ignore_patterns("__pycache__", "node_modules", "*.nbc", "*.nbi")
        shutil.copytree(ROOT / name, tree / name, ignore=ignored)
    return tree


@pytest.fixture(scope="module")
def installed(tree, tmp_path_factory):
    """A virtual environment with the wheel and, by path, what it depends on."""
    folder = tmp_path_factory.mktemp("installed")
    status, said = build(tree, folder)
    assert status == 0, said
    environment = folder / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    python = environment / "bin" / "python"
    status, said = pip("install", "--no-deps", "--no-index", *folder.glob("*.whl"), python=python)
    assert status == 0, said
    numpy = find_spec("numpy")
    assert numpy is not None
    (packages,) = environment.glob("lib/python*/site-packages")
    (packages / "dependencies.pth").write_text(f"{Path(numpy.origin).parents[1]}\n")
    return environment


@pytest.mark.parametrize("made", MADE)
def test_a_tree_without_a_made_part_gives_no_wheel_but_a_sentence(tree, tmp_path, made):
    hidden = tmp_path / "hidden"
    shutil.move(tree / made, hidden)
    try:
        status, said = build(tree, tmp_path)
    finally:
        shutil.move(hidden, tree / made)
    assert status != 0
    assert f"the wheel would lack {made}; run `make wheel`" in said
    assert not list(tmp_path.glob("*.whl"))


def test_nothing_of_an_earlier_build_is_in_a_wheel(tree, installed):
    left = tree / "build" / "lib" / "server" / "gone.py"
    left.parent.mkdir(parents=True, exist_ok=True)
    left.touch()
    status, said = build(tree, installed.parent / "again")
    assert status == 0, said
    (wheel,) = (installed.parent / "again").glob("*.whl")
    assert b"server/gone.py" not in wheel.read_bytes()


def test_the_wheel_runs_the_demo_where_nothing_else_of_it_is(installed, tmp_path):
    with Demo(
        tmp_path / "data",
        grace=(str(installed / "bin" / "grace"),),
        folder=tmp_path,
        environment={"HOME": str(tmp_path)},
    ) as demo:
        page = demo.client.get(demo.sign_in_url).raise_for_status()
        assert "<script" in page.text
        manual = httpx.get(f"{demo.url}/help", timeout=60.0).raise_for_status()
        assert "<title>Operator's manual" in html.unescape(manual.text)
        sections = httpx.get(f"{demo.url}/help/sections.json", timeout=60.0)
        assert sections.raise_for_status().json()
        demo.wait(
            "both robots being heard",
            lambda: {robot["link"]["state"] for robot in demo.get("/api/robots")} == {"live"},
            60.0,
        )


def test_an_installed_demo_says_that_the_app_has_no_sources_there(installed, tmp_path):
    done = subprocess.run(
        [installed / "bin" / "grace", "demo", "--dev", "--port", "0", "--data", tmp_path / "data"],
        cwd=tmp_path, env={"HOME": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert "--dev needs the source tree" in done.stderr
    assert "Traceback" not in done.stderr
