"""Exports for the experimenter to download, made in a process of their own that holds up no page."""

import asyncio
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from steerlab.app.console import texts
from steerlab.app.packed_export import EXPORTS, packed
from steerlab.study.contract import StudyError

EXPORT_COMMAND = (sys.executable, "-m", "steerlab.app.cli", "export")


@dataclass(frozen=True, slots=True)
class PackedExport:
    """A .zip and its file's name."""

    name: str
    content: bytes


class DataExport:
    """One export after another; a second one of the same state takes what the first has made."""

    def __init__(self, folder: Path, *, command: Sequence[str] = EXPORT_COMMAND) -> None:
        """For the study in ``folder``."""
        self._folder = folder.absolute()
        self._command = tuple(command)
        self._turn = asyncio.Lock()

    async def packed(self, format: str) -> PackedExport:
        """Export in a format, and pack what is then in the study's ``exports/``.

        Raises:
            StudyError: there is no such format, or it cannot be exported.
            SteerlabError: somebody was erased meanwhile.
        """
        if format not in texts.EXPORT_FORMATS:
            known = ", ".join(texts.EXPORT_FORMATS)
            raise StudyError(texts.EXPORT_WRONG.format(format=format[:80], known=known))
        async with self._turn:
            return await asyncio.to_thread(self._packed, format)

    def _packed(self, format: str) -> PackedExport:
        command = [*self._command, str(self._folder), "--format", format]
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONIOENCODING": "utf-8"},  # as it is read; Windows has others
        )
        if done.returncode:
            said = done.stderr.decode("utf-8", "replace").strip()
            raise StudyError(said.removeprefix("steerlab: ") or texts.EXPORT_FAILED)
        name, content = packed(self._folder, self._folder / EXPORTS / format)
        return PackedExport(f"{name}.zip", content)
