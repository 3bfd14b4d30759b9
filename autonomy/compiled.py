"""Where the project meets numba: its decorator, and the machine code kept on disk.

numba keeps machine code by a kernel's own file alone: a constant that changes in another file
leaves stale code behind, and a comment that changes makes everything new. Here each kernel is kept
by a digest of what numba compiles: its bytecode, which knows neither comments nor docstrings, the
values of the constants that it reads, and the same of every kernel that it calls. What is stale is
not found, so no process can ever run it.

Several processes never compile the same kernel at once: the first takes a lock, the others wait and
load what it made.
"""

import contextlib
import enum
import hashlib
import os
import sys
import types
from collections.abc import Callable, Generator, Iterable
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import llvmlite
import numba
import numpy as np
from numba.core.caching import Cache, CompileResultCacheImpl, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic  # pyright: ignore[reportPrivateUsage] - it has no other name

try:
    import fcntl
except ImportError:  # a platform without POSIX locks: what two compile at once is only made twice
    fcntl = None

P = ParamSpec("P")
R = TypeVar("R")

_VERSIONS = (numba.__version__, llvmlite.__version__, np.__version__)
_LOCK_FILE = "kernels.lock"
_DIGEST_LENGTH = 20
_FOREIGN = sys.stdlib_module_names | {"numba", "numpy", "scipy"}
"""Packages of which only the version counts; a kernel's names are resolved in any other."""


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a numeric hot loop at its first call and keep the machine code on disk.

    The plain function stays reachable as ``py_func``.
    """
    return _compiled(function)


def inner_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that only other kernels call.

    Called by the interpreter it runs as plain Python: to compile the way in for a tuple of fifty
    arrays takes longer than most bodies.
    """
    return _compiled(function, no_cpython_wrapper=True)


def inlined_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile an inner kernel that is called so often that the call itself would show."""
    return _compiled(function, no_cpython_wrapper=True, forceinline=True)


def inlined_entry(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that is inlined where kernels call it, and called by the interpreter too."""
    return _compiled(function, forceinline=True)


def summing_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel whose long sums may be added up in any order, and so by vector instructions.

    The result differs by rounding from that of another processor.
    """
    return _compiled(function, fastmath={"reassoc", "contract", "nsz"})


def digest_of(compiled: Callable[..., object]) -> str:
    """Return what a kernel's machine code depends on, as a hexadecimal digest.

    Raises:
        TypeError: It reads a global value of a kind that nothing is known of.
    """
    return _Digest().of_function(compiled).hex()[:_DIGEST_LENGTH]


def _compiled(function: Callable[P, R], **options: object) -> Callable[P, R]:
    dispatcher: Any = cast("Any", numba.njit)(nogil=True, no_cfunc_wrapper=True, **options)(
        function
    )
    if not isinstance(dispatcher, Dispatcher):  # NUMBA_DISABLE_JIT leaves the plain function
        return function
    cast("Any", dispatcher)._cache = _KernelCache(dispatcher)  # noqa: SLF001 - as enable_caching does
    if options.get("no_cpython_wrapper"):
        _keep_from_interpreter(dispatcher)
    return cast("Callable[P, R]", dispatcher)


def _keep_from_interpreter(dispatcher: Any) -> None:  # noqa: ANN401 - numba's own
    """Let the interpreter call the plain function where there is no way into the compiled one."""

    def add_overload(compiled: Any) -> None:  # noqa: ANN401 - numba's own
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    def plain(*_: object, **__: object) -> Callable[..., object]:
        return dispatcher.py_func

    dispatcher.add_overload = add_overload
    dispatcher._compile_for_args = plain  # noqa: SLF001 - numba calls what this returns


class _Digest:
    """Collects what a kernel depends on, each function once."""

    def __init__(self) -> None:
        self._seen: dict[int, bytes] = {}

    def of_function(self, function: Callable[..., object]) -> bytes:
        """Return the digest of a compiled or a plain function, and of all that it uses."""
        options: object = ()
        plain = function
        if isinstance(function, Dispatcher):
            options = sorted((name, repr(_sorted(o))) for name, o in function.targetoptions.items())
            plain = function.py_func
        if not isinstance(plain, types.FunctionType):
            raise TypeError(f"{function!r} is no kernel")
        known = self._seen.get(id(plain))
        if known is not None:
            return known
        # A function that calls itself is known by its name within itself.
        self._seen[id(plain)] = plain.__qualname__.encode()
        parts = [
            repr((_VERSIONS, plain.__qualname__, options)).encode(),
            _of_code(plain.__code__, skips_docstring=True),
            self._of_value(plain.__defaults__),
            *(self._of_value(cell.cell_contents) for cell in plain.__closure__ or ()),
            *self._of_globals(plain.__code__, plain.__globals__),
        ]
        found = _hash(parts)
        self._seen[id(plain)] = found
        return found

    def _of_globals(self, code: types.CodeType, known: dict[str, Any]) -> Generator[bytes]:
        names = sorted(_names(code))
        for name in names:
            if name not in known:
                continue
            value = known[name]
            yield name.encode()
            if not isinstance(value, types.ModuleType):
                yield self._of_value(value)
            elif value.__name__.partition(".")[0] in _FOREIGN:
                yield value.__name__.encode()
            else:
                for part in names:
                    if part in vars(value):
                        yield self._of_value(vars(value)[part])

    def _of_value(self, value: object) -> bytes:
        if isinstance(value, (Dispatcher, types.FunctionType)):
            return self.of_function(value)
        if isinstance(value, _Intrinsic):
            return _of_code(cast("Any", value)._defn.__code__)  # noqa: SLF001 - what it is made of
        if isinstance(value, np.ndarray):
            return _hash((repr((value.dtype.str, value.shape)).encode(), value.tobytes()))
        if isinstance(value, (tuple, list)):
            kind = f"{type(value).__qualname__} {getattr(value, '_fields', '')}"
            return _hash((kind.encode(), *(self._of_value(item) for item in value)))
        if isinstance(value, enum.EnumType):
            return repr(list(value.__members__.items())).encode()
        if isinstance(value, type):
            return (
                f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}".encode()
            )
        if isinstance(value, types.ModuleType | types.BuiltinFunctionType | np.ufunc):
            return repr(value.__name__).encode()
        if value is None or isinstance(value, (bool, int, float, complex, str, bytes, np.generic)):
            return repr(value).encode()
        raise TypeError(f"a kernel reads {value!r}, and a change of it would not be noticed")


def _of_code(code: types.CodeType, *, skips_docstring: bool = False) -> bytes:
    """Return the digest of bytecode: no line numbers, no comments, no docstring."""
    constants = code.co_consts[1:] if skips_docstring else code.co_consts
    shape = (code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return _hash(
        (
            code.co_code,
            repr((shape, names)).encode(),
            *(
                _of_code(item) if isinstance(item, types.CodeType) else repr(_sorted(item)).encode()
                for item in constants
            ),
        )
    )


def _names(code: types.CodeType) -> set[str]:
    inner = (item for item in code.co_consts if isinstance(item, types.CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _sorted(value: object) -> object:
    return sorted(value) if isinstance(value, (set, frozenset)) else value


def _hash(parts: Iterable[bytes]) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.digest()


class _KernelFile(CompileResultCacheImpl):
    """Where numba would keep a kernel's code, without the line on which it begins."""

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        plain = fullname.replace("<", "").replace(">", "")
        return f"{plain}{abiflags}"


class _KernelCache(Cache):
    """Keeps a kernel's machine code under its digest, and lets one process at a time make it."""

    _impl_class = _KernelFile

    def __init__(self, dispatcher: Dispatcher) -> None:
        self._name = repr(dispatcher.py_func)
        self._py_func = dispatcher.py_func
        self._dispatcher = dispatcher
        self._impl = _KernelFile(dispatcher.py_func)
        self._cache_path = cast("Any", self._impl.locator).get_cache_path()
        self._enabled = True

    @cached_property
    def _cache_file(self) -> IndexDataCacheFile:
        """Made at first use, when every name that the kernel reads has its value."""
        digest = digest_of(self._dispatcher)
        return IndexDataCacheFile(
            cache_path=self._cache_path,
            filename_base=f"{self._impl.filename_base}-{digest}",
            source_stamp=digest,
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: ANN401 - numba's own
        """Return the code of a signature; ``None`` tells the caller to compile, and to save it."""
        found = super().load_overload(sig, target_context)
        if found is None and self._enabled:
            self._lock(locks=True)
            found = super().load_overload(sig, target_context)
            if found is not None:
                self._lock(locks=False)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:  # noqa: ANN401 - numba's own
        """Keep the code of a signature, and let others have it."""
        try:
            super().save_overload(sig, data)
            self._forget_stale()
        finally:
            self._lock(locks=False)

    def _forget_stale(self) -> None:
        current = self.file_name()
        for kept in Path(self._cache_path).glob(f"{self._impl.filename_base}-*.nb[ic]"):
            if not kept.name.startswith(current):
                kept.unlink(missing_ok=True)

    def file_name(self) -> str:
        """Return what the names of all files of this kernel begin with."""
        return cast("Any", self._cache_file)._index_name.removesuffix(".nbi")  # noqa: SLF001

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:  # noqa: ANN401 - numba's own
        return sig, codegen.magic_tuple()

    def _lock(self, *, locks: bool) -> None:
        """Take or give back one byte of the folder's lock file, which stands for this kernel.

        A process that ends gives back what it holds. Kernels call each other in no circle, so two
        processes never wait for one another.
        """
        if fcntl is None:
            return
        place = int.from_bytes(hashlib.sha256(self.file_name().encode()).digest()[:6], "little")
        with contextlib.suppress(OSError):
            kind = fcntl.LOCK_EX if locks else fcntl.LOCK_UN
            fcntl.lockf(_lock_file(self._cache_path), kind, 1, place)


@cache
def _lock_file(folder: str) -> int:
    """Open the lock file of a folder and keep it open: to close it would give back every lock."""
    return os.open(Path(folder) / _LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o666)
