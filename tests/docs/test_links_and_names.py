"""What the documents name must exist: links, files, and definitions in files."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]+)(#[^)]*)?\)")
CODE = re.compile(r"`([^`\n]+)`")
PATH = re.compile(r"[\w.-]+(/[\w.-]+)*/?(::[\w.]+)?")
TOP = {path.name for path in ROOT.iterdir()}
BUILT = ("build/", "webui/dist", "webui/app/node_modules", "robot_link/mavlink/dialect")
"""Made by the project's own commands; not there in a fresh clone."""


def definitions(path: Path) -> set[str]:
    """Return the names that a Python file defines: ``name``, and ``Class.member``."""
    names = set[str]()
    for node in ast.parse(path.read_text()).body:
        for name in _defined(node):
            names.add(name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{name}" for member in node.body for name in _defined(member)}
    return names


def _defined(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    if isinstance(node, ast.Assign):
        return [target.id for target in node.targets if isinstance(target, ast.Name)]
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        return [node.target.id]
    return []


def missing(document: Path) -> list[str]:
    """Return what a document names and the project has not."""
    text = document.read_text()
    found = [link for link, _ in LINK.findall(text) if "://" not in link]
    faults = [f"link {link}" for link in found if not (document.parent / link).exists()]
    for code in CODE.findall(text):
        if not PATH.fullmatch(code) or "/" not in code or code.split("/")[0] not in TOP:
            continue
        place, _, name = code.partition("::")
        if place.startswith(BUILT):
            continue
        path = ROOT / place
        if not path.exists():
            faults.append(f"path {code}")
        elif name and name not in definitions(path):
            faults.append(f"name {code}")
    return faults


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_document_names_exists(document: Path) -> None:
    assert missing(document) == []


def test_a_wrong_name_is_found(tmp_path: Path) -> None:
    document = tmp_path / "guide.md"
    document.write_text("[x](nowhere.md) `server/nowhere.py` `server/app.py::nothing` `a/b`")
    assert missing(document) == [
        "link nowhere.md",
        "path server/nowhere.py",
        "name server/app.py::nothing",
    ]


def test_the_readme_names_every_package_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    packages = project["tool"]["importlinter"]["root_packages"]
    text = (ROOT / "ARCHITECTURE.md").read_text()
    assert [name for name in packages if f"`{name}/`" not in text] == []
