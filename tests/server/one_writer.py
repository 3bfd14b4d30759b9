"""Finds who in the station's code writes a state: truths that have one writer."""

import ast
from pathlib import Path

import server


def callers_of(function: str, *fields: str) -> set[str]:
    """Return the files of the station that call a function with one of these keywords.

    Without keywords every call counts; keywords that are handed on (``**changes``) count as any.
    """
    root = Path(server.__file__).parent
    found: set[str] = set()
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and _name(node.func) == function:
                given = {word.arg for word in node.keywords}
                if not fields or given & {*fields, None}:
                    found.add(path.relative_to(root).as_posix())
    return found


def _name(function: ast.expr) -> str:
    match function:
        case ast.Attribute(attr=name) | ast.Name(id=name):
            return name
        case _:
            return ""
