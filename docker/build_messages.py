"""Builds message packages into the Python environment that runs this, beside those of the ROS wheels.

usage: build_messages.py [--into PREFIX] FOLDER...

With --into they are built into another prefix: its `lib` is for LD_LIBRARY_PATH, its site-packages for PYTHONPATH, and
the prefix itself for AMENT_PREFIX_PATH. Each FOLDER is a ROS package: `package.xml` and `msg/*.msg`. The wheels hold
ROS's own generators; what CMake would do with their output, a C compiler is told to do here. Only what a Python node on
Fast DDS needs is made.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterable, Sequence
from graphlib import TopologicalSorter
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_c.cli import GenerateC
from rosidl_generator_py.cli import GeneratePython
from rosidl_generator_type_description.cli import HashTypeDescription
from rosidl_typesupport_c.cli import GenerateCTypesupport
from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

_PREFIX = Path(sys.prefix)
_INTO = Path(sys.argv[2]).resolve() if sys.argv[1:2] == ["--into"] else _PREFIX
_PACKAGES = Path(sysconfig.get_path("purelib", vars={"base": str(_INTO)}))
_INDEX = _INTO / "share/ament_index/resource_index"


def main() -> None:
    # Where the generators look for their templates.
    os.environ["AMENT_PREFIX_PATH"] = str(_PREFIX)
    named = sys.argv[1:] if _INTO == _PREFIX else sys.argv[3:]
    manifests = {folder: ET.parse(folder / "package.xml").getroot() for folder in map(Path, named)}  # noqa: S314
    folders = {manifest.findtext("name", "").strip(): folder.resolve() for folder, manifest in manifests.items()}
    needs = {name: _needs(manifest) & {*folders} for name, manifest in zip(folders, manifests.values(), strict=True)}
    for name in TopologicalSorter(needs).static_order():
        _build(name, folders[name])


def _build(name: str, folder: Path) -> None:
    messages = sorted(file.relative_to(folder) for file in folder.glob("msg/*.msg"))
    if not messages:
        sys.exit(f"{folder} has no msg/*.msg")
    with tempfile.TemporaryDirectory() as scratch:
        generated = Path(scratch) / name
        _generate(name, folder, messages, generated)
        _compile(name, generated)
        _install(name, folder, messages, generated)


def _needs(manifest: ET.Element) -> set[str]:
    """The packages that a package depends on."""
    return {element.text.strip() for element in manifest if element.tag.endswith("depend") and element.text}


def _generate(name: str, folder: Path, messages: Sequence[Path], output: Path) -> None:
    for message in messages:
        convert_msg_to_idl(folder, name, message, output / "msg")
    sources = [f"{output}:{message.with_suffix('.idl')}" for message in messages]
    share = [str(prefix / "share") for prefix in dict.fromkeys([_INTO, _PREFIX])]
    # Fast DDS serializes by the one, and describes the type to its peers by the other.
    both = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]
    hashes = HashTypeDescription("hash").generate_type_hashes(name, sources, [*share, str(output.parent)], output)
    GenerateC("c").generate(name, sources, share, output, hashes)
    GenerateFastRTPSCTypesupport("fastrtps_c").generate(name, sources, share, output)
    GenerateIntrospectionCTypesupport("introspection_c").generate(name, sources, share, output)
    GenerateCTypesupport("c", typesupport_implementations=both).generate(name, sources, share, output)
    GeneratePython("py", typesupport_implementations=["rosidl_typesupport_c"]).generate(name, sources, share, output)


def _compile(name: str, generated: Path) -> None:
    """Make the five libraries that ROS makes of a package, and the module that rclpy imports."""
    detail = generated / "msg/detail"
    libraries = _INTO / "lib"
    libraries.mkdir(parents=True, exist_ok=True)
    generator_c = libraries / f"lib{name}__rosidl_generator_c.so"
    fastrtps_c = libraries / f"lib{name}__rosidl_typesupport_fastrtps_c.so"
    introspection_c = libraries / f"lib{name}__rosidl_typesupport_introspection_c.so"
    typesupport_c = libraries / f"lib{name}__rosidl_typesupport_c.so"
    generator_py = libraries / f"lib{name}__rosidl_generator_py.so"
    module = generated / f"{name}_s__rosidl_typesupport_c.so"
    functions = [*detail.glob("*__functions.c"), *detail.glob("*__description.c")]
    _link(generated, functions, generator_c, [])
    _link(generated, detail.glob("*__type_support_c.cpp"), fastrtps_c, [generator_c])
    _link(generated, detail.glob("*__type_support.c"), introspection_c, [generator_c])
    _link(generated, generated.glob("msg/*__type_support.cpp"), typesupport_c, [generator_c])
    _link(generated, generated.glob("msg/_*_s.c"), generator_py, [generator_c])
    entry = [generated / f"_{name}_s.ep.rosidl_typesupport_c.c"]
    _link(generated, entry, module, [generator_c, typesupport_c, generator_py])


def _link(generated: Path, sources: Iterable[Path], library: Path, needed: Sequence[Path]) -> None:
    ours = ("rosidl_*", "*__rosidl_generator_*", "*__rosidl_typesupport_*c", "fastcdr", "rmw", "rcutils")
    prefixes = [_INTO, _PREFIX]
    files = (file for prefix in prefixes for pattern in ours for file in (prefix / "lib").glob(f"lib{pattern}.so"))
    there = sorted({*files} - {library})
    headers = [prefix / "include" for prefix in prefixes if (prefix / "include").is_dir()]
    includes = [
        generated.parent,
        *headers,
        *(folder for each in headers for folder in each.iterdir()),
        sysconfig.get_path("include"),
        np.get_include(),
    ]
    command = ["g++", "-shared", "-fPIC", "-O2", "-Wl,-rpath,$ORIGIN", "-o", str(library)]
    for source in sources:
        compiled = source.with_suffix(f"{source.suffix}.o")
        compiler = ["g++", "-std=c++17"] if source.suffix == ".cpp" else ["gcc"]
        options = ["-fPIC", "-O2", *(f"-I{folder}" for folder in includes)]
        subprocess.run([*compiler, *options, "-c", str(source), "-o", str(compiled)], check=True)
        command.append(str(compiled))
    subprocess.run([*command, *map(str, needed), "-Wl,--as-needed", *map(str, there)], check=True)


def _install(name: str, folder: Path, messages: Sequence[Path], generated: Path) -> None:
    package, share = _PACKAGES / name, _INTO / "share" / name
    (package / "msg").mkdir(parents=True, exist_ok=True)
    (package / "__init__.py").touch()
    for file in generated.glob("msg/*.py"):
        shutil.copy(file, package / "msg")
    shutil.copy(generated / f"{name}_s__rosidl_typesupport_c.so", package)
    shutil.copytree(generated / "msg", share / "msg", ignore=_all_but(".idl", ".json"), dirs_exist_ok=True)
    for file in (*messages, Path("package.xml")):
        shutil.copy(folder / file, share / file)
    headers = _INTO / "include" / name / name / "msg"
    shutil.copytree(generated / "msg", headers, ignore=_all_but(".h", "detail"), dirs_exist_ok=True)
    listed = sorted(str(file) for message in messages for file in (message, message.with_suffix(".idl")))
    for kind, content in (("rosidl_interfaces", "\n".join(listed)), ("packages", "")):
        (_INDEX / kind).mkdir(parents=True, exist_ok=True)
        (_INDEX / kind / name).write_text(content)


def _all_but(*kept: str) -> Callable[[str, list[str]], list[str]]:
    """Have a copy ignore all names but those with these endings."""
    return lambda _, names: [name for name in names if not name.endswith(kept)]


if __name__ == "__main__":
    main()
