"""Install steerlab and what it needs into the environment whose Python runs this.

    tools/install.py run|dev [--torch CHOICE] [--wheel FILE]

Packages are pinned in requirements/ and checked by hash. PyTorch is pinned by version alone: what
pip takes by default on Linux is a build for NVIDIA cards that is several times as large as all the
rest, so the build is chosen here. CHOICE, or the variable TORCH:

    auto    the CPU build unless there is an NVIDIA card; if it cannot be had, what pip finds
    cpu     the CPU build or nothing
    cuda    what pip finds: on Linux the build for NVIDIA cards
    else    handed to pip as it is: a wheel's path, or "torch==2.13.0 --index-url ADDRESS"

The CPU build comes by uv, which knows where PyTorch keeps it. Only the standard library is used.
"""

import argparse
import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
LISTS = TOP / "requirements"
TORCH = (LISTS / "torch.txt").read_text(encoding="utf-8").strip()
# --no-compile: byte code is written when a module is first used, and most never are (200 MB).
PIP = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
PIP += ["--no-compile"]


@dataclass(frozen=True)
class Size:
    """Of a set of packages, measured on Linux x86-64 with Python 3.11."""

    name: str
    download_gb: float
    disk_gb: float


CPU = Size("PyTorch's CPU build", 0.2, 0.7)
CUDA = Size("PyTorch's build for NVIDIA cards", 2.7, 4.8)
OTHERS = {"run": Size("packages", 0.4, 1.4), "dev": Size("packages for tests", 0.9, 3.2)}


class CannotInstall(Exception):
    """What is wrong and how to mend it."""


def main(arguments: list[str] | None = None) -> int:
    """Install: 0 done, 2 it could not be done, and why."""
    parser = argparse.ArgumentParser(prog="tools/install.py")
    parser.add_argument("kind", choices=("run", "dev"))
    parser.add_argument("--torch", default=os.environ.get("TORCH") or "auto")
    parser.add_argument("--wheel", type=Path, help="steerlab's wheel, instead of this folder")
    options = parser.parse_args(arguments)
    try:
        install(options.kind, options.torch, options.wheel)
    except CannotInstall as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def install(kind: str, torch: str, wheel: Path | None) -> None:
    """Everything: the pinned packages, PyTorch, steerlab itself."""
    wanted = [OTHERS[kind]]
    if not torch_is_here():
        nvidia = torch == "cuda" or (torch == "auto" and has_nvidia_card())
        wanted.append(CUDA if nvidia and platform.system() == "Linux" else CPU)
        check_room(*wanted)
    print("Installing", " and ".join(one.name for one in wanted), flush=True)
    pip("--require-hashes", "--no-deps", "--requirement", str(LISTS / f"{kind}.txt"))
    if CPU in wanted:
        install_cpu_build(torch)
    elif CUDA in wanted:
        pip(TORCH)
    drop_test_programs()
    this = ["--editable", str(TOP)] if wheel is None else ["--force-reinstall", str(wheel)]
    pip("--no-deps", "--no-build-isolation", *this)


def torch_is_here() -> bool:
    """Whether the pinned version is installed, in any build."""
    try:
        return version("torch").split("+")[0] == TORCH.split("==")[1]
    except PackageNotFoundError:
        return False


def check_room(*wanted: Size) -> None:
    """Say what is needed before it starts.

    Raises:
        CannotInstall: the disk has no room for it.
    """
    download_gb = sum(one.download_gb for one in wanted)
    disk_gb = sum(one.disk_gb for one in wanted)
    free_gb = shutil.disk_usage(sys.prefix).free / 1e9
    print(f"Needed: {download_gb:.1f} GB to download, {disk_gb:.1f} GB on disk", flush=True)
    if free_gb < disk_gb:
        raise CannotInstall(
            f"{sys.prefix} has {free_gb:.1f} GB free and {disk_gb:.1f} GB are needed; make room, "
            "or put the repository on another disk."
        )


def install_cpu_build(torch: str) -> None:
    """PyTorch's CPU build, or what was named instead; with ``auto`` in the end what pip finds.

    Raises:
        CannotInstall: it cannot be had.
    """
    if torch not in ("auto", "cpu"):
        pip(*shlex.split(torch))
    elif found_by_pip() is CPU:
        pip(TORCH)
    elif not installed_by_uv():
        reason = "PyTorch's CPU build cannot be had: its index does not answer (see above)."
        if torch == "cpu":
            raise CannotInstall(
                f"{reason} Get the wheel of {TORCH} elsewhere and name it: make TORCH=FILE"
            )
        print(reason, f"Going on with {CUDA.name}. To avoid that: make TORCH=FILE, a wheel.")
        check_room(CUDA)
        pip(TORCH)


def drop_test_programs() -> None:
    """Remove the test programs that PyTorch's wheel carries: 120 MB that nothing ever loads."""
    torch = Path(sysconfig.get_path("platlib")) / "torch"
    shutil.rmtree(torch / "test", ignore_errors=True)
    for program in [*torch.glob("bin/test_*"), *torch.glob("bin/*Test")]:
        program.unlink()


def has_nvidia_card() -> bool:
    """Whether a driver for NVIDIA cards answers."""
    if Path("/proc/driver/nvidia/version").exists():
        return True
    program = shutil.which("nvidia-smi")
    return (
        program is not None and not subprocess.run([program, "-L"], capture_output=True).returncode
    )


def found_by_pip() -> Size:
    """Which build pip takes as it is set up here; asks for the build's metadata only.

    Raises:
        CannotInstall: pip finds none.
    """
    if platform.system() != "Linux":  # elsewhere what pip finds needs nothing of NVIDIA's
        return CPU
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        pip("--dry-run", "--ignore-installed", "--no-deps", "--report", str(report), TORCH)
        found = json.loads(report.read_text(encoding="utf-8"))
    requires = found["install"][0]["metadata"].get("requires_dist", [])
    return CUDA if any(name.startswith(("nvidia-", "cuda-")) for name in requires) else CPU


def installed_by_uv() -> bool:
    """Let uv install the CPU build; False where it cannot reach it."""
    with tempfile.TemporaryDirectory() as folder:
        pip("--require-hashes", "--target", folder, "--requirement", str(LISTS / "uv.txt"))
        uv = Path(folder) / "bin" / ("uv.exe" if os.name == "nt" else "uv")
        done = subprocess.run(
            [uv, "pip", "install", "--python", sys.executable, "--torch-backend", "cpu", TORCH],
            env={"UV_HTTP_RETRIES": "1"} | os.environ,
        )
    return done.returncode == 0


def pip(*arguments: str) -> None:
    """Run ``pip install``, which says itself what went wrong.

    Raises:
        CannotInstall: it failed.
    """
    if subprocess.run([*PIP, *arguments]).returncode:
        raise CannotInstall(
            "Installing failed; see above. Check the network and the disk, then run make again."
        )


if __name__ == "__main__":
    sys.exit(main())
