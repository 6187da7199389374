"""What pyproject.toml cannot say: compiled code is built where there are a C compiler and Python's headers."""

import hashlib
import logging
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import BaseError, CCompilerError

# As syncrelay.sync.compiled has them.
_SOURCES = sorted(each for each in Path("syncrelay").glob("*/compiled/*.p*") if each.suffix in (".pxi", ".pyx"))
_FINGERPRINT = hashlib.sha256(b"".join(each.read_bytes() for each in _SOURCES)).hexdigest()


class _BuildWherePossible(build_ext):
    def initialize_options(self) -> None:
        super().initialize_options()
        self.cython_c_in_temp = True
        self.force = True

    def build_extension(self, ext: Extension) -> None:
        built = Path(self.get_ext_fullpath(ext.name))
        in_clone = Path(ext.sources[0]).with_name(built.name)
        # Every venv of this Python that is installed from the clone uses the one that is there.
        if in_clone.exists() and _FINGERPRINT.encode() in in_clone.read_bytes():
            if in_clone.absolute() != built.absolute():
                self.copy_file(in_clone, built)
            return
        # If this build fails, the result of an earlier one must not be installed in its place.
        in_clone.unlink(missing_ok=True)
        built.unlink(missing_ok=True)
        try:
            super().build_extension(ext)
        except (BaseError, CCompilerError) as error:
            self.announce(
                f"syncrelay is installed without {ext.name}: each message costs more CPU ({error})",
                logging.WARNING,
            )


setup(
    ext_modules=[
        Extension(
            ".".join(source.with_suffix("").parts),
            [str(source)],
            depends=[str(each) for each in _SOURCES if each.suffix == ".pxi"],
            define_macros=[("SYNCRELAY_SOURCE", f'"{_FINGERPRINT}"')],
            extra_compile_args=["-g0"],
            optional=True,
        )
        for source in _SOURCES
        if source.suffix == ".pyx"
    ],
    cmdclass={"build_ext": _BuildWherePossible},
)
