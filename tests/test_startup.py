"""What an import brings along: packages that take a second to load come only where they serve.

Each group is imported in a fresh process of its own. How long it takes is for
``benchmarks/startup.py``.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from steerlab.app.cli import VERBS

TOP = Path(__file__).parents[1]

# Whoever trains, loads or asks a network. Everything else in these layers needs no torch.
WITH_NETWORKS = {
    "sim": [],
    "teleop": [],
    "study": [
        "teaching.human_interface",
        "teaching.live_round",
        "teaching.run_teaching",
        "teaching.scripted_interface",
        "teaching.teaching_log",
    ],
    "analysis": [],
    "app": [
        "fit",
        "population_run",
        "simulate",
        "synthetic",
        "teach",
        "teach_config",
        "teach_people",
        "teach_shards",
        "teach_units",
    ],
}
NOT_ALWAYS_INSTALLED = ["steerlab.sim.engine.drive_to_ball"]  # the extra dm-control
WITH_STATISTICS_OR_FIGURES = ["analyze", "export", "power"]
LEARNING_WITHOUT_NETWORKS = [
    "steerlab.learning." + name
    for name in (
        "certainty",
        "empirical_bayes.mapper",
        "label_file",
        "label_quality",
        "label_table",
        "pretrained.style",
        "pretrained.teachers",
        "probe",
        "series",
        "splits",
        "synthetic.drives",
    )
]
MAPPERS = [
    "steerlab.learning." + name
    for name in (
        "mapper",
        "checkpoint",
        "streaming",
        "baselines",
        "pretrained.mapper",
        "pretrained.known_people",
        "empirical_bayes.mapper",
        "batch_mapping",
    )
]


def _modules(layer: str, without: list[str]) -> list[str]:
    names = [
        ".".join(path.relative_to(TOP / layer).with_suffix("").parts)
        for path in sorted((TOP / layer).rglob("*.py"))
        if path.name != "__init__.py"
    ]
    assert set(without) <= set(names)
    found = [f"steerlab.{layer}.{name}" for name in names if name not in without]
    return [name for name in found if name not in NOT_ALWAYS_INSTALLED]


def _under(layer: str, *names: str) -> tuple[str, ...]:
    return tuple(f"steerlab.{layer}.{name}" for name in names)


def _brought(modules: list[str], packages: tuple[str, ...]) -> dict[str, str]:
    """Which of ``packages`` are loaded after importing ``modules``, and by which first."""
    code = (
        "import sys, json, importlib\n"
        "modules, packages = json.loads(sys.argv[1])\n"
        "brought = {}\n"
        "for module in modules:\n"
        "    importlib.import_module(module)\n"
        "    for package in packages:\n"
        "        if package in sys.modules:\n"
        "            brought.setdefault(package, module)\n"
        "print(json.dumps(brought))\n"
    )
    given = json.dumps([modules, packages])
    done = subprocess.run(
        [sys.executable, "-c", code, given], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("layer", WITH_NETWORKS)
def test_what_needs_no_network_brings_no_torch(layer):
    assert _brought(_modules(layer, WITH_NETWORKS[layer]), ("torch",)) == {}


def test_records_teachers_and_the_store_compile_nothing():
    """Planning needs numba and driving MuJoCo; the rest of ``sim`` neither."""
    drives = ("engine.", "ground_truth.", "calibration_generator", "tasks", "wizard")
    plain = [one for one in _modules("sim", []) if not one.startswith(_under("sim", *drives))]
    plain += [one for one in _modules("study", []) if one.startswith(_under("study", "store."))]
    assert _brought(plain, ("numba", "mujoco", "scipy", "matplotlib", "torch")) == {}


def test_surveys_and_records_bring_neither_statistics_nor_figures():
    reliability = "steerlab.study.surveys.reliability"  # Cronbach's alpha has an interval
    surveys = [one for one in _modules("study", []) if one.startswith(_under("study", "surveys."))]
    plain = [one for one in surveys if one != reliability]
    plain += ["steerlab.analysis.summary", "steerlab.analysis.study_data.records"]
    plain += ["steerlab.analysis.study_data.conditions_file"]
    assert _brought(plain, ("numba", "scipy", "matplotlib", "torch")) == {}


def test_statistics_bring_no_compiler_and_no_figures():
    found = _modules("analysis", [])
    statistics = [one for one in found if one.startswith(_under("analysis", "statistics."))]
    assert _brought(statistics, ("numba", "matplotlib", "torch")) == {}


def test_wheel_study_and_console_bring_no_learning():
    heavy = ("torch", "numba", "scipy.stats", "scipy.signal", "matplotlib")
    without = [*WITH_NETWORKS["app"], *WITH_STATISTICS_OR_FIGURES]
    reliability = "surveys.reliability"  # Cronbach's alpha has an interval
    modules = _modules("teleop", [])
    modules += _modules("study", [*WITH_NETWORKS["study"], reliability])
    assert _brought([*modules, *_modules("app", without)], heavy) == {}


def test_learning_without_networks_is_numpy():
    heavy = ("torch", "numba", "scipy", "mujoco", "matplotlib")
    assert _brought(LEARNING_WITHOUT_NETWORKS, heavy) == {}


def test_a_mapper_brings_torch_and_nothing_else():
    """numba when it trains or maps, scipy when it judges a new person, pyarrow when it reads."""
    heavy = ("numba", "scipy", "mujoco", "matplotlib", "pyarrow", "pandas")
    assert _brought(MAPPERS, heavy) == {}


def test_help_brings_nothing():
    """Not even what tyro would load to compare defaults: typeguard, and with it asyncio."""
    acts = ("new", "enrol", "run", "resume", "train", "status", "withdraw", "verify")
    lines = [[], *([verb] for verb in VERBS), *(["study", act] for act in acts)]
    packages = (
        "torch", "mujoco", "numba", "numpy", "scipy", "matplotlib", "pyarrow", "rerun", "pygame",
        "rich", "typeguard", "asyncio", "cattrs", "steerlab.learning", "steerlab.analysis",
    )  # fmt: skip
    code = (
        "import sys, json\n"
        "from steerlab.app.cli import main\n"
        "lines, packages = json.loads(sys.argv[1])\n"
        "brought = {}\n"
        "for line in lines:\n"
        "    try:\n"
        "        assert main([*line, '--help']) == 0\n"
        "    except SystemExit as stop:\n"
        "        assert stop.code == 0\n"
        "    for package in packages:\n"
        "        if package in sys.modules:\n"
        "            brought.setdefault(package, ' '.join(line))\n"
        "print(json.dumps(brought))\n"
    )
    given = json.dumps([lines, packages])
    done = subprocess.run(
        [sys.executable, "-c", code, given], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout.splitlines()[-1]) == {}
