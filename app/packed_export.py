"""A finished export, as it lies in a study: what its summary says, and all of it as a .zip.

Nothing here needs the analysis, which the console does not load.
"""

import json
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from steerlab.sim.files.output_folder import OutputError
from steerlab.study.derived import ERASED_BEFORE, EXPORT_LABEL, ErasureGuard

SUMMARY, VERB = "summary.json", "export"
EXPORTS = "exports"
"""In the study's folder: where exports go if nothing else is said."""
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest there is: the same export packs to the same bytes


def summary_of(place: Path) -> dict[str, Any] | None:
    """The summary of the export in a folder; None if there is none."""
    try:
        values = json.loads((place / SUMMARY).read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    ours = isinstance(values, dict) and values.get("verb") == VERB
    return values if ours and isinstance(values.get("study"), str) else None


def packed(folder: Path, place: Path) -> tuple[str, bytes]:
    """A finished export of the study in ``folder`` as a .zip, whose comment says that it is one.

    Returns:
        the name of the one folder in it, and its bytes.

    Raises:
        SteerlabError: there is none, or somebody was erased since it was made.
    """
    guard, content = ErasureGuard.of(folder), BytesIO()
    with guard.placing():
        summary = summary_of(place)
        if summary is None or set(summary.get(ERASED_BEFORE, ())) != guard.erased:
            raise OutputError(f"{place} holds no export as the study is now; export it again.")
        name = f"{summary['study']}-{place.name}"
        with ZipFile(content, "w", ZIP_DEFLATED) as archive:
            archive.comment = f"{EXPORT_LABEL} {summary['study']}".encode()
            for path in sorted(place.rglob("*")):
                if path.is_file():
                    inside = f"{name}/{path.relative_to(place).as_posix()}"
                    info = ZipInfo(inside, _ZIP_TIME)
                    info.compress_type = ZIP_DEFLATED
                    archive.writestr(info, path.read_bytes())
    return name, content.getvalue()
