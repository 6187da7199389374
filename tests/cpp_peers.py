"""Builds the programs that run C++ libraries from Debian, with which our own are compared."""

import hashlib
import os
import shutil
import subprocess
from pathlib import Path

import pytest


def built(request, source, *, package, headers, libraries):
    """The program of one source file; skips the test where the package of its headers, or a compiler, is missing."""
    if not all(header.exists() for header in headers):
        pytest.skip(f"{package} is not installed: apt-get install {package}")
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip(f"no g++ to build {source.name} with")
    # To compile message_filters' templates takes 18 s of CPU: it is kept between runs, by what it was made of.
    made_of = hashlib.sha256(b"".join(map(Path.read_bytes, (source, *headers))))
    binary = request.config.cache.mkdir("peer") / made_of.hexdigest()
    if not binary.exists():
        unfinished = binary.with_suffix(f".{os.getpid()}")
        words = [f"-l{library}" for library in libraries]
        subprocess.run([str(compiler), "-std=c++17", "-w", source, "-o", unfinished, *words], check=True)
        unfinished.replace(binary)
    return binary
