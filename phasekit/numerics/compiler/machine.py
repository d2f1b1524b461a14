"""From LLVM's language to machine code of this processor, and into this process."""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Any

import llvmlite.binding as llvm

_LOCK = threading.Lock()
_ENGINES: list[Any] = []  # machine code lives as long as the process
_FILES: ContextVar[dict[int, bytes] | None] = ContextVar("files", default=None)


@functools.cache
def target() -> Any:
    """The kind of machine that this process runs on."""
    try:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
    except RuntimeError:
        pass  # newer versions initialise themselves
    return llvm.Target.from_triple(llvm.get_process_triple())


@functools.cache
def processor() -> tuple[str, str]:
    """The processor's name, and what it can do."""
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def target_machine(effort: int) -> Any:
    """What writes machine code, as engines of llvmlite take it."""
    name, features = processor()
    reloc = "static" if target().name.startswith("x86") else "default"
    return target().create_target_machine(
        cpu=name, features=features, opt=effort, reloc=reloc, codemodel="jitdefault"
    )


def assemble(text: str, effort: int) -> bytes:
    """Compile a module; the object file.

    Effort 0: as fast as that can be, values stay in memory. 1: optimised. 2: with loops over many
    numbers at once, which takes twice as long and pays in loops that are long.
    """
    if effort == 0:
        text = text.replace(" alwaysinline", "")  # calls take less time to compile than copies
    with _LOCK:
        machine = target_machine(2 if effort else 0)
        module = llvm.parse_assembly(text)
        module.triple = llvm.get_process_triple()
        module.data_layout = str(machine.target_data)
        module.verify()
        if effort:
            tuning = llvm.create_pipeline_tuning_options(speed_level=2)
            tuning.loop_vectorization = tuning.slp_vectorization = effort > 1
            tuning.loop_unrolling = effort > 1
            builder = llvm.create_pass_builder(machine, tuning)
            builder.getModulePassManager().run(module, builder)
        return bytes(machine.emit_object(module))


@contextlib.contextmanager
def object_files() -> Iterator[dict[int, bytes]]:
    """Object files of what `finalized` compiles in this context, by the addresses of it."""
    files: dict[int, bytes] = {}
    token = _FILES.set(files)
    try:
        yield files
    finally:
        _FILES.reset(token)


def finalized(engine: Any, name: str) -> int:
    """Compile what an engine holds, for as long as the process lives; the address of a function."""
    files, images = _FILES.get(), list[bytes]()
    if files is not None:
        engine.set_object_cache(lambda _, image: images.append(image))
    engine.finalize_object()
    _ENGINES.append(engine)
    address = int(engine.get_function_address(name))
    if files is not None:
        (files[address],) = images
    return address


def load(image: bytes, names: tuple[str, ...]) -> dict[str, int]:
    """Take an object file into this process; addresses of what it defines."""
    with _LOCK:
        empty = llvm.parse_assembly("")
        engine = llvm.create_mcjit_compiler(empty, target_machine(0))
        engine.add_object_file(llvm.ObjectFileRef.from_data(image))
        engine.finalize_object()
        _ENGINES.append(engine)
        # Of functions and data alike.
        return {name: int(engine.get_function_address(name)) for name in names}
