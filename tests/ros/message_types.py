"""Message classes by name, for the processes of the tests: independent of the relay's own import."""

import importlib
from typing import Any


def import_type(type_name: str) -> Any:
    package, kind, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)
