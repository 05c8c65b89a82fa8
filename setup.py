"""Refuse to build from a clone without links; all else stands in pyproject.toml."""

import os

from setuptools import setup

if not os.path.isdir("femubench/core"):
    raise SystemExit(
        "femubench/core is no link to the folder core: clone once more with "
        "`git clone -c core.symlinks=true` (on Windows, in developer mode)"
    )
setup()
