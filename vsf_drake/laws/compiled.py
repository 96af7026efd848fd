"""The two ways in which this package compiles functions; the machine code is kept on disk for later
processes.

numba takes kept code for valid as long as the file of the compiled function is the same; but that
code also holds the functions of other files that it calls. So our code is kept in a folder that is
named after the content of every file with compiled functions: in NUMBA_CACHE_DIR if that is set,
else in the package's own `__pycache__`, else in the user's cache; where none of them can be written
every process compiles anew. Of processes that need the same function at the same time, as the
workers of a first sweep do, one compiles it and the others wait.

Division by zero gives infinity as in numpy arrays, not an exception; the steppers look for numbers
that are not finite. An index into an array is not negative unless it is written as a number, as in
x[-1]; to find one that is beyond its end, NUMBA_BOUNDSCHECK=1 and an empty NUMBA_CACHE_DIR. With
NUMBA_DISABLE_JIT=1, for a debugger, nothing is compiled, and such a division of two Python numbers
raises.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import logging
import multiprocessing
import operator
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from types import BuiltinFunctionType
from typing import Any, ParamSpec, Protocol, TypeVar, cast

import numba
import numpy as np
from llvmlite.ir import Constant, Undefined
from llvmlite.ir.instructions import InsertValue
from numba.core import compiler, event, types
from numba.core.cgutils import alloca_once_value, unpack_tuple
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.typing.context import Context
from numba.extending import models, register_jitable, register_model
from numba.np.arrayobj import load_item, store_item

from vsf_drake.base.threads import garbage_left

COMPILED = (
    "laws",
    "simulation/stepping",
    "simulation/reactions.py",
    "systems/_foot_kernel.py",
    "systems/_massless_kernel.py",
    "motion/events.py",
)
"""Parts of the package that compiled functions and the constants in them come from."""
KEPT = 4
"""How many states of the sources keep their machine code for longer than a day after they were last
used."""
LOADED_S = 1.0  # a function that is kept is loaded within less
_PACKAGE = Path(__file__).resolve().parents[1]
_settings: Any = numba.config  # whose attributes it makes at the import
_lock = threading.Lock()
_P = ParamSpec("_P")
_R_co = TypeVar("_R_co", covariant=True)


class Compiled(Protocol[_P, _R_co]):
    """A compiled function; its annotations are for readers and the type check, numba looks at the
    values."""

    @property
    def py_func(self) -> Callable[_P, _R_co]:
        """The function as it was written."""

    @property
    def signatures(self) -> list[tuple[Any, ...]]:
        """Types of the arguments with which it has been compiled."""

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R_co: ...


def sources_sha256(package: Path, parts: Iterable[str]) -> str:
    """Of names and content of all Python files and templates in `parts` (folders and files) of
    `package`."""
    digest = hashlib.sha256()
    paths = [package / part for part in parts]
    for file in (
        file
        for path in paths
        for file in (
            [path]
            if path.suffix
            else sorted(file for kind in ("*.py", "*.j2") for file in path.rglob(kind))
        )
    ):
        digest.update(f"\0{file.relative_to(package).as_posix()}\0".encode() + file.read_bytes())
    return digest.hexdigest()


def compiled(
    function: Callable[_P, _R_co], *, allocates: bool = False, **own: Any
) -> Compiled[_P, _R_co]:
    """For functions that Python calls too; `own` are options of numba's. Only one that `allocates`
    arrays counts references to them, which makes half of the code that there is to compile."""
    if _settings.DISABLE_JIT:
        plain: Any = function
        plain.py_func = function
        return cast("Compiled[_P, _R_co]", plain)
    options: dict[str, Any] = {
        "pipeline_class": _Pipeline,
        "error_model": "numpy",
        "no_cfunc_wrapper": True,
        "_nrt": allocates,
    } | own
    # kept, it would be found under its name by who wants to call it
    inner = options.get("no_cpython_wrapper")
    if _FOLDER and not inner and _unchanged(function.__code__.co_filename):
        with _lock:
            # is read when a function is decorated
            users = _settings.CACHE_DIR
            _settings.CACHE_DIR = _FOLDER
            try:
                on_disk = numba.njit(cache=True, **options)(function)
            except RuntimeError:  # numba has found no folder to keep it in
                on_disk = None
            finally:
                _settings.CACHE_DIR = users
        if on_disk is not None and str(on_disk.stats.cache_path).startswith(_FOLDER):
            _take_turns(on_disk)
            return cast("Compiled[_P, _R_co]", on_disk)
    return cast("Compiled[_P, _R_co]", numba.njit(**options)(function))


class _Unfinished(JITCodeLibrary):
    """The code of a function that only compiled ones call: it is optimised where it has become a
    part of one that Python calls, and not by itself before, which would take half of the time that
    compiling takes. Where numba has no such steps it is finished as any other."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """There is none to call from Python."""
        return 0

    @property
    def codegen(self) -> Any:
        """Takes the place where a finished function is told of Python's objects."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """There is none to tell."""


class _Forms(types.Function):
    """A function of numba's that remembers which of its forms goes with which types: of `x * y`
    numba looks through all that there is of strings, dates and sets again wherever it stands,
    twice, which is a third of the time that compiling takes."""

    def __init__(self, templates: Any) -> None:
        super().__init__(templates)
        self._known: dict[Any, Any] = {}

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """The signature for these types."""
        if kws:
            return super().get_call_type(context, args, kws)
        known = self._known.get(args)
        if known is None:
            known = super().get_call_type(context, args, kws)
            self._known[args] = known
        return known


register_model(_Forms)(models.OpaqueModel)


@cache
def _forms(kind: Any) -> Any:
    """The `_Forms` of a function of numba's; the same of any other type."""
    return _Forms(kind.templates) if type(kind) is types.Function else kind


class _Typing(Context):
    """numba's own, whose contents it shares, with functions that are `_Forms`."""

    def __init__(self, own: Context) -> None:
        self.__dict__ = own.__dict__

    def resolve_value_type(self, val: Any) -> Any:
        """The type of a constant, or of a function."""
        return _forms(super().resolve_value_type(val))

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """The signature of `func` for these types; of a function of ours for any whole number where
        one is given as such, for which it would be compiled again."""
        if isinstance(func, BuiltinFunctionType):
            func = self._lookup_global(func) or func
        if isinstance(func, types.Function):
            return _forms(func).get_call_type(self, args, kws)
        if isinstance(func, types.Dispatcher):
            args = tuple(types.unliteral(arg) for arg in args)
        return super().resolve_function_type(func, args, kws)


_typing = cache(_Typing)


class _Target(CPUContext):
    """numba's own, which reads and writes numbers of contiguous arrays, asks for their shapes and
    counts in a tenth of the instructions: of what there is to compile they are three quarters. An
    index that is not written as a number is not negative."""

    def __init__(self, own: Any, typing: Any) -> None:
        self.__dict__ = own.__dict__ | {"typing_context": typing}

    def get_function(self, fn: Any, sig: Any, _firstcall: bool = True) -> Any:
        """How a function is written: as (builder, arguments) -> result."""
        own = super().get_function(fn, sig, _firstcall)
        operation = getattr(fn, "typing_key", fn)
        if operation in (operator.getitem, operator.setitem) and _single(*sig.args):
            return own if self.enable_boundscheck else partial(self._item, sig.args, own)
        if operation is range and sig.return_type == types.range_state64_type:
            return self._range
        if operation == "getiter" and sig.args == (types.range_state64_type,):
            return partial(self._first, own)
        if operation == "iternext" and sig.args == (types.range_iter64_type,):
            return partial(self._next, sig.return_type)
        return own

    def _made(self, builder: Any, kind: Any, *members: Any) -> Any:
        made = Constant(self.get_value_type(kind), Undefined)
        for place, member in enumerate(members):
            made = builder.insert_value(made, member, place)
        return made

    def _range(self, builder: Any, values: Any, *_: Any) -> Any:
        start = self.get_constant(types.int64, 0) if len(values) == 1 else values[0]
        stop = values[min(1, len(values) - 1)]
        step = values[2] if len(values) == 3 else self.get_constant(types.int64, 1)
        return self._made(builder, types.range_state64_type, start, stop, step)

    def _first(self, own: Any, builder: Any, values: Any, *_: Any) -> Any:
        start, stop, step = _unpacked(builder, values[0])
        if not (isinstance(step, Constant) and step.constant in (1, -1)):
            return own(builder, values)
        count = builder.sub(stop, start) if step.constant == 1 else builder.sub(start, stop)
        here = alloca_once_value(builder, start)
        left = alloca_once_value(builder, count)
        return self._made(builder, types.range_iter64_type, here, stop, step, left)

    def _next(self, pair: Any, builder: Any, values: Any, *_: Any) -> Any:
        here, _, step, left = unpack_tuple(builder, values[0])
        number = builder.load(here)
        count = builder.load(left)
        builder.store(builder.add(number, step), here)
        builder.store(builder.sub(count, self.get_constant(types.int64, 1)), left)
        more = builder.icmp_signed(">", count, self.get_constant(types.int64, 0))
        return self._made(builder, pair, number, more)

    def _item(self, kinds: Any, own: Any, builder: Any, values: Any, *_: Any) -> Any:
        array = kinds[0]
        model = self.data_model_manager[array]
        parts = values[1:2]
        if isinstance(kinds[1], types.BaseTuple):
            parts = _unpacked(builder, values[1])
        places = [
            self.cast(builder, part, of, types.intp)
            for of, part in zip(_axes(kinds[1]), parts, strict=True)
        ]
        if any(isinstance(place, Constant) and place.constant < 0 for place in places):
            return own(builder, values)
        at = places[0]
        lengths = unpack_tuple(builder, model.get(builder, values[0], "shape"))
        for along, length in zip(places[1:], lengths[1:], strict=True):
            at = builder.add(builder.mul(at, length), along)
        place = builder.gep(model.get(builder, values[0], "data"), [at])
        if len(kinds) == 2:
            return load_item(self, builder, array, place)
        value = self.cast(builder, values[2], kinds[2], array.dtype)
        return store_item(self, builder, array, value, place)

    def get_getattr(self, typ: Any, attr: str) -> Any:
        """How an attribute is read: (context, builder, type, value, name) -> result."""
        if attr == "shape" and isinstance(typ, types.Array):
            return lambda context, builder, typ, value, attr: self.data_model_manager[typ].get(
                builder, value, "shape"
            )
        return super().get_getattr(typ, attr)


def _unpacked(builder: Any, packed: Any) -> list[Any]:
    """What a tuple was made of; of one that is made elsewhere its members."""
    parts: dict[int, Any] = {}
    made = packed
    while isinstance(made, InsertValue):
        parts.setdefault(made.indices[0], made.operands[1])
        made = made.operands[0]
    if len(parts) < len(packed.type):
        return list(unpack_tuple(builder, packed))
    return [parts[i] for i in range(len(parts))]


def _axes(index: Any) -> Any:
    return index if isinstance(index, types.BaseTuple) else (index,)


def _single(array: Any, index: Any, *value: Any) -> bool:
    """Whether that is one number of a contiguous array."""
    return (
        isinstance(array, types.Array)
        and array.layout == "C"
        and len(_axes(index)) == array.ndim
        and all(isinstance(axis, types.Integer) for axis in _axes(index))
    )


_NEEDLESS = {
    "DumpParforDiagnostics",
    "FindLiterally",
    "InlineClosureLikes",
    "InlineInlinables",
    "InlineOverloads",
    "LiteralPropagationSubPipelinePass",
    "LiteralUnroll",
    "MakeFunctionToJitFunction",
    "NoPythonSupportedFeatureValidation",
    "NopythonRewrites",
    "WithLift",
}
"""Steps of numba's that look for what our functions do not have, as functions inside them and
expressions of whole arrays: a tenth of the time that compiling takes."""


class _Pipeline(compiler.Compiler):
    """Compiles functions that Python calls."""

    def define_pipelines(self) -> Any:
        """numba's own steps, but the needless ones."""
        typing = _typing(self.state.typingctx)
        self.state.typingctx = typing
        self.state.targetctx = _Target(self.state.targetctx, typing)
        pipelines = super().define_pipelines()
        for each in pipelines:
            each.passes = [made for made in each.passes if made[0].__name__ not in _NEEDLESS]
            each.finalize()
        return pipelines


class _Inside(_Pipeline):
    """Compiles functions that only compiled ones call."""

    def define_pipelines(self) -> Any:
        """numba's own steps."""
        codegen = self.state.targetctx.codegen()
        self.state.library = _Unfinished(codegen, self.state.func_id.func_qualname)
        return super().define_pipelines()


def internal(function: Callable[_P, _R_co]) -> Compiled[_P, _R_co]:
    """For functions that only compiled ones call, which become a part of these: calling one from
    Python ends the interpreter."""
    return compiled(function, no_cpython_wrapper=True, forceinline=True, pipeline_class=_Inside)


def part(function: Callable[_P, _R_co]) -> Compiled[_P, _R_co]:
    """For long functions that only compiled ones call: as `internal`, but called and not copied
    to where it is."""
    return compiled(function, no_cpython_wrapper=True, forceinline=False, pipeline_class=_Inside)


def _take_turns(dispatcher: Any) -> None:
    """One process at a time compiles this function for the same arguments, or loads it."""
    compile_or_load = dispatcher.compile

    def in_turn(signature: tuple[Any, ...]) -> Any:
        if signature in dispatcher.overloads:
            return compile_or_load(signature)
        function = dispatcher.py_func
        name = f"{function.__module__}.{function.__qualname__} {signature}"
        # numba's own lock comes first in every thread, else two of them could wait for each other.
        # Looking through what the compiler makes for garbage is a seventh of its time.
        waiting = partial(announced.tell, dispatcher)
        with global_compiler_lock, _alone(name, waiting=waiting), garbage_left():
            return compile_or_load(signature)

    dispatcher.compile = in_turn


@contextlib.contextmanager
def _alone(name: str, *, waiting: Callable[[], None]) -> Iterator[None]:
    """While no other process is within the same `name`, if the file system has locks; `waiting` is
    called if that takes longer than loading does."""
    lock = Path(_FOLDER) / f"{hashlib.sha256(name.encode()).hexdigest()[:16]}.lock"
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):
            file = os.open(lock, os.O_RDWR | os.O_CREAT)
            held.callback(os.close, file)
            by_then = time.monotonic() + LOADED_S
            while not _locked(file) and time.monotonic() < by_then:
                time.sleep(0.02)
            if not _locked(file):
                waiting()
                fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _locked(file: int) -> bool:
    """Whether this process has the lock on an open file now."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


_INSIDE = {
    "error_model": "numpy",
    "_nrt": False,
    "forceinline": True,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _Inside,
}


def generic(function: Callable[_P, _R_co]) -> Callable[_P, _R_co]:
    """For functions of any kind of number: of float64 and `lanes.Lane` in compiled functions, which
    they become a part of, and as they are written in Python, of floats, AutoDiffXd and arrays of
    either."""
    either: Any = register_jitable(**_INSIDE)(function)
    return cast("Callable[_P, _R_co]", either)


class _Announced(event.Listener):
    """Says once why nothing seems to happen: before what takes long is compiled, not where its code
    is kept, nor in the processes that a command starts."""

    said = False

    def on_start(self, event: Any) -> None:
        """A function is to be compiled."""
        self.tell(event.data["dispatcher"])

    def tell(self, dispatcher: Any) -> None:
        """A function is to be compiled, or another process compiles it and this one waits."""
        own = dispatcher.py_func.__module__.startswith(
            ("vsf_drake.simulation.", "vsf_drake.systems.")
        )
        if own and not self.said and multiprocessing.parent_process() is None:
            self.said = True
            logging.getLogger("vsf_drake").warning("compiling once, about 20 s")

    def on_end(self, event: Any) -> None:
        """It was."""


announced = _Announced()
event.register("numba:compile", announced)


@cache
def _unchanged(_file: str) -> bool:
    """Whether the sources are still those of the folder's name, asked once for each file that is
    imported."""
    return sources_sha256(_PACKAGE, COMPILED) == _SOURCES


def _folder() -> str:
    """Where this state of the sources keeps its machine code; empty if nowhere."""
    if _settings.DISABLE_JIT:
        return ""
    state = f"{_SOURCES} {numba.__version__} {np.__version__}"
    name = f"vsf_drake-{hashlib.sha256(bytes(_PACKAGE)).hexdigest()[:8]}"
    # not numba's own setting, which a .numba_config.yaml of the current folder may have made: what
    # is kept is run
    homes = (
        [os.path.abspath(os.environ["NUMBA_CACHE_DIR"])]
        if os.environ.get("NUMBA_CACHE_DIR")
        else []
    )
    homes += [
        str(_PACKAGE / "__pycache__"),
        os.environ.get("XDG_CACHE_HOME", ""),
        os.path.expanduser("~/.cache"),
    ]
    # ~ stays as it is where there is no home, and would be in this folder
    for home in filter(os.path.isabs, homes):
        try:
            folder = Path(home) / name / hashlib.sha256(state.encode()).hexdigest()[:16]
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)  # says when it was last used
        except OSError:
            continue
        with contextlib.suppress(OSError):  # of another process that does the same
            for old in sorted(folder.parent.iterdir(), key=os.path.getmtime, reverse=True)[KEPT:]:
                if os.path.getmtime(old) < time.time() - 86400.0:
                    # numba makes it again for a process that still uses it
                    shutil.rmtree(old, ignore_errors=True)
        return str(folder)
    return ""


@dataclass(frozen=True)
class KeptCode:
    """The machine code on disk, in the folder of this process's sources."""

    folder: str  # "" where none can be written
    functions: int  # that are kept, of the same sources and the same numba and numpy
    size_mb: float
    current: bool  # whether the sources on disk are still those that this process runs


def kept_code() -> KeptCode:
    """What is kept now."""
    files = [file for file in Path(_FOLDER).rglob("*") if file.is_file()] if _FOLDER else []
    return KeptCode(
        folder=_FOLDER,
        functions=sum(file.suffix == ".nbi" for file in files),
        size_mb=1e-6 * sum(file.stat().st_size for file in files),
        current=sources_sha256(_PACKAGE, COMPILED) == _SOURCES,
    )


_SOURCES = sources_sha256(_PACKAGE, COMPILED)
_FOLDER = _folder()
