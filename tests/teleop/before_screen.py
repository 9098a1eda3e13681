"""Puts a made-up person before the real screen: what is shown to people is shown to them."""

from types import ModuleType
from typing import Any

from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import SdlEvents


def sit_before(person: Any, *opening: ModuleType) -> None:
    """Let ``person`` look at every page and drive, in this program from now on.

    Args:
        person: has ``sit_down``, called once SDL runs, ``look_at_page`` and ``look_at_drive``; may
            have ``look_at_world``.
        opening: the modules whose ``SdlEvents`` open the window.
    """

    class Events(SdlEvents):
        def __init__(self, *, window: bool) -> None:
            super().__init__(window=window)
            person.sit_down()

    show_page, show_drive, enter = DriveScreen.show_page, DriveScreen.show_drive, DriveScreen.enter

    def page_and_look(screen, page):
        show_page(screen, page)
        person.look_at_page(screen, page)

    def drive_and_look(screen, view):
        show_drive(screen, view)
        person.look_at_drive(screen, view)

    def enter_and_look(screen, world):
        if hasattr(person, "look_at_world"):
            person.look_at_world(world)
        enter(screen, world)

    for module in opening:
        module.SdlEvents = Events
    DriveScreen.show_page, DriveScreen.show_drive = page_and_look, drive_and_look
    DriveScreen.enter = enter_and_look
