"""Files of a kind in a folder: by what their names end in, in whatever case other systems left it."""

from pathlib import Path


def has_suffix(path: Path, suffix: str) -> bool:
    """Whether a name ends in ``suffix``, such as ``.toml``; ``.TOML`` is the same."""
    return path.suffix.casefold() == suffix


def files_with(folder: Path, suffix: str) -> list[Path]:
    """The files in a folder that have the suffix, by name; none if there is no such folder."""
    return sorted(path for path in folder.glob("*") if has_suffix(path, suffix))
