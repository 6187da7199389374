"""ros/ holds what needs ROS, and nothing else: what needs none is tested, and used, without it."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import syncrelay

_PACKAGE: Final = Path(syncrelay.__file__).parent
_ROS: Final = _PACKAGE / "ros"

# What needs ROS though it imports none of it.
_WITHOUT_IMPORT: Final = {
    "syncrelay.ros": "the package",
    "syncrelay.ros.environment": "asks whether rclpy can be imported at all",
    "syncrelay.ros.leaving": "takes a node from librcl through ctypes",
}


def _name(path: Path) -> str:
    return ".".join(path.relative_to(_PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def _imported(path: Path) -> Iterator[str]:
    """Every module that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{each.name}" for each in node.names)


def _is_of_ros(module: str) -> bool:
    package = module.partition(".")[0]
    return package == "rclpy" or package.endswith(("_msgs", "_interfaces"))


def test_every_module_of_ros_needs_ros():
    imported = {_name(path): set(_imported(path)) for path in sorted(_ROS.rglob("*.py"))}
    needs_ros = {name for name, modules in imported.items() if any(map(_is_of_ros, modules))}
    needs_ros |= _WITHOUT_IMPORT.keys() - {"syncrelay.ros"}
    before: set[str] = set()
    while needs_ros != before:
        before = set(needs_ros)
        needs_ros |= {name for name, modules in imported.items() if modules & needs_ros}
    assert imported.keys() - needs_ros == {"syncrelay.ros", "syncrelay.ros.compiled"}
    assert imported.keys() >= _WITHOUT_IMPORT.keys()


def test_no_other_module_but_those_of_the_relay_needs_ros_to_be_imported():
    at_import = {
        _name(path): module
        for path in _PACKAGE.rglob("*.py")
        if _ROS not in path.parents and _PACKAGE / "relay" not in path.parents
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for module in [getattr(node, "module", None) or node.names[0].name]
        if _is_of_ros(module) and module.partition(".")[0] not in sys.stdlib_module_names
    }
    assert at_import == {}
