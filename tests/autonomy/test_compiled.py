"""Kept machine code: what makes it anew, what does not, and that stale code is never loaded."""

import importlib
import multiprocessing
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest
from numba.core.dispatcher import Dispatcher

from autonomy import warm_up
from autonomy.compiled import digest_of

CALLED = '''"""What is called."""
from autonomy.compiled import kernel
GAIN = 2.0

@kernel
def scaled(x: float) -> float:
    """Scale."""
    return GAIN * x
'''
CALLER = '''"""What calls, by a name and by a module."""
import kernel_called
from autonomy.compiled import kernel
from kernel_called import scaled

@kernel
def shifted(x: float) -> float:
    """Scale and shift."""
    return scaled(x) + 1.0

@kernel
def twice(x: float) -> float:
    return 2.0 * kernel_called.scaled(x)

@kernel
def apart(x: float) -> float:
    return x + 3.0
'''
NAMES = ("kernel_called", "kernel_caller")
Load = Callable[..., ModuleType]


def loaded(folder: Path, called: str, caller: str) -> ModuleType:
    for name, text in zip(NAMES, (called, caller), strict=True):
        (folder / f"{name}.py").write_text(text)
        sys.modules.pop(name, None)
    importlib.invalidate_caches()
    for kept in (folder / "__pycache__").glob("*.pyc"):
        kept.unlink()
    return importlib.import_module("kernel_caller")


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Load]:
    """Write two modules of kernels and import them as a process does that starts afresh."""
    monkeypatch.syspath_prepend(str(tmp_path))
    yield lambda called=CALLED, caller=CALLER: loaded(tmp_path, called, caller)
    for name in NAMES:
        sys.modules.pop(name, None)


def digests(module: ModuleType) -> dict[str, str]:
    return {name: digest_of(getattr(module, name)) for name in ("shifted", "twice", "apart")}


def test_docstrings_comments_and_lines_do_not_change_a_digest(load: Load):
    before = digests(load())
    caller = CALLER.replace("Scale and shift.", "Say it\n\n    in more lines.")
    called = CALLED.replace('    """Scale."""\n', "    # nothing to say\n")
    assert digests(load(called, "# moved down\n\n\n" + caller)) == before


def test_a_constant_of_a_called_kernel_in_another_file_changes_every_caller(load: Load):
    before = digests(load())
    after = digests(load(CALLED.replace("GAIN = 2.0", "GAIN = 2.5")))
    assert after["shifted"] != before["shifted"]
    assert after["twice"] != before["twice"]
    assert after["apart"] == before["apart"]


def test_an_operator_that_changes_in_a_called_kernel_changes_its_callers(load: Load):
    before = digests(load())
    after = digests(load(CALLED.replace("GAIN * x", "GAIN + x")))
    assert {name for name in before if before[name] != after[name]} == {"shifted", "twice"}


def test_options_of_the_compiler_change_a_digest(load: Load):
    before = digests(load())
    fast = CALLED.replace("import kernel", "import summing_kernel as kernel")
    assert digests(load(fast))["shifted"] != before["shifted"]


def test_stale_code_is_not_loaded(load: Load, tmp_path: Path):
    assert load().shifted(1.0) == 3.0
    stale = {path.name for path in tmp_path.rglob("*.nbc")}
    anew = load(CALLED.replace("GAIN = 2.0", "GAIN = 5.0"))
    assert anew.shifted(1.0) == 6.0
    assert sum(anew.shifted.stats.cache_hits.values()) == 0
    assert stale.isdisjoint(path.name for path in tmp_path.rglob("*.nbc"))


def test_a_changed_docstring_compiles_nothing_anew(load: Load):
    load().shifted(1.0)
    again = load(CALLED.replace("Scale.", "Scale it."), CALLER.replace("Scale and", "Grow and"))
    assert again.shifted(1.0) == 3.0
    assert sum(again.shifted.stats.cache_hits.values()) == 1
    assert sum(again.shifted.stats.cache_misses.values()) == 0


def test_an_inner_kernel_runs_as_plain_python_when_the_interpreter_calls_it(load: Load):
    module = load(CALLED.replace("kernel", "inner_kernel"))
    assert module.scaled(4.0) == 8.0
    assert module.shifted(4.0) == 9.0
    assert module.scaled(4) == 8.0


def compile_shifted(folder: str) -> int:
    sys.path.insert(0, folder)
    shifted = importlib.import_module("kernel_caller").shifted
    shifted(1.0)
    return sum(shifted.stats.cache_hits.values())


@pytest.mark.process
def test_two_processes_at_once_compile_a_kernel_once(load: Load, tmp_path: Path):
    load()
    # one piece each: a process that took both would not look for the other's code
    with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=1) as pool:
        hits = pool.map(compile_shifted, [str(tmp_path)] * 2, chunksize=1)
    assert sum(hits) == 1


def test_every_kernel_has_a_digest_and_a_file_of_its_own():
    for step in warm_up.STEPS:
        importlib.import_module(step.partition(":")[0])
    kernels = {
        id(value): value
        for name, module in list(sys.modules.items())
        if name.startswith("autonomy.")
        for value in vars(module).values()
        if isinstance(value, Dispatcher)
    }
    assert len(kernels) > 100
    assert len({compiled._cache.file_name() for compiled in kernels.values()}) == len(kernels)


def test_steps_are_complete_only_for_the_sources_that_were_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(warm_up, "_stamp", lambda is_flight: tmp_path / str(is_flight))
    digest = warm_up.source_digest()
    warm_up.note_complete(digest, flight_only=True)
    assert warm_up.is_complete(flight_only=True)
    assert not warm_up.is_complete()
    warm_up.note_complete(digest)
    assert warm_up.is_complete()
    monkeypatch.setattr(warm_up, "source_digest", lambda: "other")
    assert not warm_up.is_complete()
