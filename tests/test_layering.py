"""The house: assets < sim < {learning, teleop} < study < analysis < app; imports point down only."""

import ast
import warnings
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]
BELOW = {
    "assets": (),
    "sim": ("assets",),
    "learning": ("assets", "sim"),
    "teleop": ("assets", "sim"),
    "study": ("assets", "sim", "learning", "teleop"),
    "analysis": ("assets", "sim", "learning", "teleop", "study"),
    "app": ("assets", "sim", "learning", "teleop", "study", "analysis"),
}
FILES = sorted(path for folder in BELOW for path in (TOP / folder).rglob("*.py"))
LONG = 400  # lines; a file is as big as its idea, and one of this length probably holds two


def _imports(path: Path) -> list[str]:
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno} imports relatively"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def _upward(path: Path, imports: list[str]) -> list[str]:
    folder = path.relative_to(TOP).parts[0]
    allowed = {folder, *BELOW[folder]}
    return [
        f"{path.relative_to(TOP)}: {name}"
        for name in imports
        if name.startswith("steerlab.") and name.split(".")[1] not in allowed
    ]


def test_imports_point_down_and_only_the_engine_touches_mujoco():
    """Elsewhere MuJoCo could be imported before an OpenGL back end is chosen."""
    assert _upward(TOP / "sim" / "world.py", ["steerlab.learning.mapper.LabelMapper"])
    assert _upward(TOP / "teleop" / "loop.py", ["steerlab.learning.mapper.LabelMapper"])
    found = {path: _imports(path) for path in FILES}
    assert [name for path, imports in found.items() for name in _upward(path, imports)] == []
    touching = {
        path.relative_to(TOP).parts[:2]
        for path, imports in found.items()
        for name in imports
        if name.split(".")[0] in ("mujoco", "dm_control", "OpenGL")
    }
    assert touching == {("sim", "engine")}


@pytest.mark.filterwarnings("default")
def test_every_folder_is_a_package_and_nothing_pickles_or_seeds_globally():
    """``setup.py`` finds what has an ``__init__.py``; docstrings may speak of what code may not do."""
    assert {path.parent for path in FILES if not (path.parent / "__init__.py").exists()} == set()
    calls = {"torch.load", "np.random.seed", "random.seed", "torch.manual_seed"}
    found = [path for path in FILES if {"pickle", "joblib", "dill"} & set(_imports(path))]
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in calls:
                found.append(path)
        if (lines := text.count("\n")) > LONG:
            warnings.warn(f"{path.relative_to(TOP)} has {lines} lines", stacklevel=1)
    assert found == []
