"""Finds the packages: each top folder is ``steerlab.<folder>``, and folders below follow it."""

from setuptools import find_packages, setup

FOLDERS = ("assets", "sim", "learning", "teleop", "study", "analysis", "app")
found = [name for name in find_packages(".") if name.split(".")[0] in FOLDERS]
setup(packages=[f"steerlab.{name}" for name in found], package_dir={"steerlab": "."})
