"""The layers: assets < sim < learning < analysis < teleop; imports point down only."""

import ast
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]
LAYERS = ("assets", "sim", "learning", "analysis", "teleop")
FILES = sorted(path for layer in LAYERS for path in (TOP / layer).rglob("*.py"))


def _imports(path: Path) -> list[str]:
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno} imports relatively"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def _upward(path: Path, imports: list[str]) -> list[str]:
    layer = LAYERS.index(path.relative_to(TOP).parts[0])
    allowed = {f"steerlab.{name}" for name in LAYERS[: layer + 1]}
    return [
        name
        for name in imports
        if name.split(".")[0] == "steerlab" and ".".join(name.split(".")[:2]) not in allowed
    ]


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(TOP)))
def test_no_import_points_up(path):
    assert _upward(path, _imports(path)) == []


def test_an_upward_import_would_be_seen():
    assert _upward(TOP / "sim" / "world.py", ["steerlab.learning.mapper.LabelMapper"])


def test_only_the_engine_touches_mujoco():
    """Elsewhere MuJoCo could be imported before an OpenGL back end is chosen."""
    touching = {
        path.relative_to(TOP).parts[:2]
        for path in FILES
        for name in _imports(path)
        if name.split(".")[0] in ("mujoco", "dm_control", "OpenGL")
    }
    assert touching == {("sim", "engine")}


def test_every_folder_is_a_package():
    """``setup.py`` finds what has an ``__init__.py``; another folder would be missing in a wheel."""
    assert {path.parent for path in FILES if not (path.parent / "__init__.py").exists()} == set()


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(TOP)))
def test_files_stay_small(path):
    assert len(path.read_text().splitlines()) <= 300


def test_no_pickle_and_no_global_seed():
    """Neither in code; docstrings may speak of them."""
    calls = {"torch.load", "np.random.seed", "random.seed", "torch.manual_seed"}
    found = [path for path in FILES if {"pickle", "joblib", "dill"} & set(_imports(path))]
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in calls:
                found.append((path, node.lineno))
    assert found == []
