"""Scripts of ``examples`` and the notebook, against a real demo."""

import base64
import json
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests.e2e.demo import ROOT, Demo
from tests.e2e.test_demo import pilot_of

pytestmark = [pytest.mark.walk, pytest.mark.timeout(2400)]
NOTEBOOK = ROOT / "examples" / "plan_fly_map.ipynb"
FIGURES = ROOT / "build" / "notebook"


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    robots = ("--robots", "mini-1,mini-2,grace-1")
    with Demo(tmp_path_factory.mktemp("scripts"), "--speed", "20", *robots) as demo:
        demo.sign_in()
        for robot in ("mini-1", "mini-2", "grace-1"):
            path = f"/api/robots/{robot}/state"
            demo.wait("a first report", lambda path=path: demo.get(path)["position"], 60.0)
        yield demo


def run(demo, script, *options):
    done = subprocess.run(
        [sys.executable, f"examples/{script}.py", "--url", demo.url, *options],
        cwd=ROOT, env=pilot_of(demo), capture_output=True, text=True, check=False, timeout=900,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("script", "options", "words"),
    [
        ("lawnmower",
         ("--robot", "grace-1", "--south", "150", "--north", "350", "--west", "150", "--east",
          "350", "--spacing-m", "100"), " legs, "),
        ("fleet_survey", ("--robot", "mini-1", "--robot", "mini-2", "--planning-time-s", "5"),
         "mini-2: plan-"),
        ("track_target", ("--robot", "mini-1", "--target", "virtual"), "plan-"),
    ],
)  # fmt: skip
def test_a_script_plans_and_sends_nothing_by_default(demo, script, options, words):
    said = run(demo, script, *options)
    assert words in said
    assert "nothing was sent" in said
    assert demo.get("/api/events", kind="plan.sent")["events"] == []


def test_the_notebook_is_kept_without_what_it_showed():
    for cell in json.loads(NOTEBOOK.read_text())["cells"]:
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None


def test_the_notebook_plans_flies_and_maps(demo, monkeypatch):
    for name, value in pilot_of(demo).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("GRACE_URL", demo.url)
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=1500, resources={"metadata": {"path": str(ROOT)}}).execute()
    figures = list(keep_figures(notebook, FIGURES))
    assert len(figures) == 4
    assert all(len(figure) > 5000 for figure in figures)


def keep_figures(notebook: nbformat.NotebookNode, folder: Path):
    """Write the figures where a person can look at them; yield their bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, cell in enumerate(notebook.cells):
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                picture = base64.b64decode(output["data"]["image/png"])
                (folder / f"cell-{number}.png").write_bytes(picture)
                yield picture
