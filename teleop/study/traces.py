"""Files that hold something of one participant's, besides the database."""

from pathlib import Path

from steerlab.teleop.recording.session_recorder import RECORDINGS
from steerlab.teleop.study.frozen_files import MODELS


def traces(folder: Path, participant: str) -> list[Path]:
    """Recordings, whole or in parts, and models with the participant's w; empty once erased."""
    return [
        *(folder / RECORDINGS).glob(f"{participant}-*"),
        *(folder / RECORDINGS).glob(f".{participant}-*"),
        *(folder / MODELS).glob(f"*-{participant}.safetensors*"),
    ]
