"""What pyproject.toml cannot say: the compiled path is built where a C compiler and Python's headers are."""

import hashlib
import logging
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import BaseError, CCompilerError

_SOURCE = Path("syncrelay/ros/compiled/path.pyx")


class _BuildWherePossible(build_ext):
    def initialize_options(self) -> None:
        super().initialize_options()
        self.cython_c_in_temp = True
        self.force = True

    def build_extension(self, ext: Extension) -> None:
        # What an earlier build left would be taken for this one's if this one fails.
        built = Path(self.get_ext_fullpath(ext.name))
        built.unlink(missing_ok=True)
        if self.editable_mode:
            _SOURCE.with_name(built.name).unlink(missing_ok=True)
        try:
            super().build_extension(ext)
        except (BaseError, CCompilerError) as error:
            self.announce(
                f"syncrelay is installed without its compiled path: it does the same, at a higher cost ({error})",
                logging.WARNING,
            )


_FINGERPRINT = hashlib.sha256(_SOURCE.read_bytes()).hexdigest()

setup(
    ext_modules=[
        Extension(
            "syncrelay.ros.compiled.path",
            [str(_SOURCE)],
            define_macros=[("SYNCRELAY_SOURCE", f'"{_FINGERPRINT}"')],
            extra_compile_args=["-g0"],
            optional=True,
        )
    ],
    cmdclass={"build_ext": _BuildWherePossible},
)
