"""What a broken limit of timing means, in words for who runs the study."""

from collections.abc import Iterable, Mapping

WORDS: Mapping[str, str] = {
    "lateness_p99_ms": "the computer was late",
    "lateness_max_ms": "the computer was very late once",
    "dropped_share": "pictures were left out",
    "overrun_share": "steps took too long",
    "input_age_p99_ms": "the wheel was heard late",
}
"""By the field of ``GateConfig`` that names the limit."""


def in_words(names: Iterable[str]) -> str:
    """Broken limits, by their fields' names, each once and in the order of ``WORDS``."""
    broken = set(names)
    return ", ".join(words for name, words in WORDS.items() if name in broken)
