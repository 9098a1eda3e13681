"""How learners are called and drawn: one name, colour and line for each, in figures and recordings."""

from collections.abc import Sequence
from dataclasses import dataclass

from steerlab.analysis.figures.look import BLUE, INK, MUTED, VERMILLION

_NAMES = {
    "bc": "BC",
    "dagger": "DAgger",
    "dagger-beta": "DAgger, β = 0.5ⁱ",
    "mind-meld": "MIND MELD",
    "mind-meld-mean": "MIND MELD, mean w",
    "oracle": "Oracle",
    "hg-dagger": "HG-DAgger",
    "safe-dagger": "SafeDAgger",
    "ensemble-dagger": "EnsembleDAgger",
    "eil": "EIL",
    "coaching": "Coaching",
    "shiv": "SHIV",
    "confidence": "Confidence",
    "mapped:sim_pretrained": "pre-trained mapper",
    "mapped:sim_pretrained_context": "pre-trained, with motion",
    "mapped:person_gain": "gain per person",
    "mapped:person_gain_lag": "gain and lag per person",
    "mapped:person_ridge": "ridge per person",
    "mapped:true_style": "true style",
}
# Okabe & Ito; MIND MELD and the oracle keep the colours they have in all figures.
_COLOURS = {"mind-meld": BLUE, "oracle": VERMILLION, "dagger": INK, "bc": "#E69F00"}
_OTHERS = ("#CC79A7", "#009E73", "#56B4E9", "#8C6D31", "#7B61A8", MUTED)
_DASHES = ("--", ":", "-.")


@dataclass(frozen=True, slots=True)
class Look:
    """How one learner is drawn."""

    colour: str
    line: str


def learner_name(key: str) -> str:
    """A learner's key in words, spelt as a learner or as a study's condition (``mind_meld``)."""
    known = _NAMES.get(key) or _NAMES.get(key.replace("_", "-"))
    return known or key.removeprefix("mapped:").replace("_", " ")


def learner_looks(names: Sequence[str]) -> dict[str, Look]:
    """A look for each, in order; the well-known keep theirs whatever stands beside them."""
    known = {name: _COLOURS.get(name.replace("_", "-")) for name in names}
    looks = {name: Look(colour, "-") for name, colour in known.items() if colour}
    others = [name for name in names if name not in looks]
    for row, name in enumerate(others):
        line = _DASHES[row // len(_OTHERS) % len(_DASHES)]
        looks[name] = Look(_OTHERS[row % len(_OTHERS)], line)
    return {name: looks[name] for name in names}
