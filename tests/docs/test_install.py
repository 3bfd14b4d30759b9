"""What the page of installation tells an administrator to type must exist."""

import re
from pathlib import Path

import pytest

from server.base.settings import Settings
from server.cli.main import main
from server.cli.option import TOKEN_VARIABLE

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/install.md").read_text()
COMMANDS = [
    line.split("  #")[0]
    for block in re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    for line in block.splitlines()
]
GRACE = [
    re.sub(r"^(?:.*bin/)?grace ", "", line)
    for line in COMMANDS
    if re.search(r"bin/grace |^grace ", line)
]
SETTINGS = [f"GRACE_{name.upper()}" for name in Settings.model_fields]
TOLD = [*GRACE, *(code.removeprefix("grace ") for code in re.findall(r"`(grace [^`]+)`", PAGE))]


def test_files_that_are_copied_exist():
    named = re.findall(r"\b(?:deploy/[\w.]+|requirements[\w-]*\.lock)", PAGE)
    assert len(named) > 6
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_settings_that_are_named_exist():
    files = "".join((ROOT / "deploy" / name).read_text() for name in ("grace.env", "Containerfile"))
    named = set(re.findall(r"\bGRACE_([A-Z][A-Z_]+)\b", PAGE + files))
    assert {f"GRACE_{name}" for name in named} <= {*SETTINGS, TOKEN_VARIABLE}


def test_every_setting_is_listed():
    (table,) = re.findall(r"## Settings\n(.*?)\n## ", PAGE, re.DOTALL)
    listed = re.findall(r"`([A-Z_]+)`", table)
    assert sorted(f"GRACE_{name}" for name in listed) == sorted(SETTINGS)


def test_a_shell_and_systemd_read_the_settings_alike():
    """What is no plain word stands in single quotes, in lines that wait to be chosen as well."""
    lines = [
        line.removeprefix("#").partition("=")[2]
        for line in (ROOT / "deploy/grace.env").read_text().splitlines()
        if re.match(r"#?GRACE_", line)
    ]
    assert len(lines) > 6
    assert [line for line in lines if not re.fullmatch(r"[\w./:-]+|'[^']+'", line)] == []


@pytest.mark.parametrize("told", sorted(set(TOLD)))
def test_verbs_and_options_that_are_told_exist(told, capsys):
    words = told.split()
    verbs = [word for word in words[:2] if re.fullmatch(r"[a-z]+", word)]
    with pytest.raises(SystemExit) as ended:
        main([*verbs, "--help"])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert [word for word in words if word.startswith("--") and word not in shown] == []
