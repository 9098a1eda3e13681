"""Notice that the X server went away, instead of being ended by it silently.

Xlib ends the process when its connection breaks: no ``finally``, no ``atexit``, exit code 1. It
does not if a handler of its own is set (libX11 1.7 and later), and SDL's calls then do nothing.
"""

import atexit
import ctypes
from collections.abc import Callable
from typing import Any

from steerlab.sim.errors import SteerlabError

_lost = False


class DisplayLost(SteerlabError):
    """The window's display is gone; SDL must not be used, nor closed, any more."""

    def __init__(self) -> None:
        super().__init__(
            "The display has gone away (the X server or the remote desktop ended), and the window "
            "with it. Every step until then is kept; log in again and resume the session."
        )


def display_is_lost() -> bool:
    """The X connection broke; SDL would then wait for ever when it closes its window."""
    return _lost


_IoHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)
_ExitHandler = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


def outlive_display(window_info: dict[str, Any], quit_sdl: Callable[[], None]) -> bool:
    """Let the process outlive its X server, so that it can report that and end in order.

    Args:
        window_info: ``pygame.display.get_wm_info()``.
        quit_sdl: what is registered to run at exit; it would never return (SDL#8392).

    Returns:
        Whether it will; False on other window systems and with older libraries.
    """

    def give_up(_display: int | None, _data: int | None) -> None:
        global _lost
        _lost = True
        atexit.unregister(quit_sdl)

    capsule = window_info.get("display")
    if type(capsule).__name__ != "PyCapsule":
        return False
    try:
        x11 = ctypes.CDLL("libX11.so.6")  # the very library SDL has loaded
        set_io_handler, set_exit_handler = x11.XSetIOErrorHandler, x11.XSetIOErrorExitHandler
    except (OSError, AttributeError):
        return False
    address = ctypes.pythonapi.PyCapsule_GetPointer
    address.restype, address.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    io_handler, exit_handler = _IoHandler(lambda _display: 0), _ExitHandler(give_up)
    _handlers.extend((io_handler, exit_handler))
    set_io_handler.argtypes = (_IoHandler,)
    set_exit_handler.argtypes = (ctypes.c_void_p, _ExitHandler, ctypes.c_void_p)
    set_exit_handler.restype = None
    set_io_handler(io_handler)
    set_exit_handler(address(capsule, b"display"), exit_handler, None)
    return True


_handlers: list[Any] = []  # Xlib keeps their addresses, so they must live as long as the process
