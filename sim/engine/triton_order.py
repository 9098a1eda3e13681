"""Load Triton before an OpenGL driver can load LLVM: in the other order the process dies.

PyTorch's CUDA build brings Triton, which carries an LLVM of its own; Mesa's software drivers load
LLVM as a shared library, whose symbols PyOpenGL makes visible to everyone. A Triton that is loaded
after it (``torch.optim`` does that) finds those instead of its own and ends in a segmentation
fault. Loaded first, both keep their own.
"""

import ctypes
import importlib.util
import logging
import sys
from pathlib import Path

_log = logging.getLogger(__name__)


def settle_triton() -> None:
    """Make it safe to draw and to train in this process, in any order; without Triton do nothing.

    Where someone has already opened such a driver, Triton is kept out instead: importing it then
    raises ``ImportError``, with which PyTorch goes on. Call it before MuJoCo is imported.
    """
    if sys.platform != "linux" or "triton" in sys.modules:
        return
    found = importlib.util.find_spec("triton")
    if found is None or found.origin is None:
        return
    if _llvm_is_loaded():
        _log.info("an OpenGL driver was opened before steerlab was imported: no Triton here")
        sys.modules["triton"] = None  # pyright: ignore[reportArgumentType] - Python's own way
        return
    library = Path(found.origin).parent / "_C" / "libtriton.so"
    try:
        if library.exists():
            ctypes.CDLL(str(library))  # 20 ms; the whole package takes 100
        else:
            importlib.import_module("triton")
    except (OSError, ImportError) as error:  # what cannot be loaded now cannot be later either
        _log.info("Triton cannot be loaded: %s", error)


def _llvm_is_loaded() -> bool:
    """Whether this process has LLVM's shared library open."""
    try:
        return "/libLLVM" in Path("/proc/self/maps").read_text(encoding="utf-8")
    except OSError:  # no /proc, as in some sandboxes: then the usual order is taken for granted
        return False
