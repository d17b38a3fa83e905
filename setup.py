"""Puts ``bt_tasksim.pth`` beside the package, for the short names of `bt_tasksim._names`."""

import os
import sys
import sysconfig
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

NAME = "bt_tasksim.pth"


class WithData(Distribution):
    """`editable_wheel` asks for ``has_data`` before it installs data files."""

    has_data = Distribution.has_data_files


class BuildWithNames(build_py):
    """Builds the packages, and puts the file into the wheel's root."""

    def run(self) -> None:
        """Build."""
        super().run()
        if not self.editable_mode:
            self.copy_file(NAME, str(Path(self.build_lib) / NAME))


# An editable wheel holds no built files: there it goes as data, to where this Python keeps its packages.
places = sysconfig.get_paths()
site = os.path.relpath(places["purelib"], places["data"])
data = [(site, [NAME])] if "editable_wheel" in sys.argv else []
setup(distclass=WithData, cmdclass={"build_py": BuildWithNames}, data_files=data)
