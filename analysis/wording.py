"""Numbers, names and results in words: what a page, a figure or a terminal says."""

from collections.abc import Mapping

from steerlab.analysis.summary import MAPPER, Summary

_MINUS = "\u2212"
_NARROW_SPACE = "\u202f"  # between a number and its unit; does not break
_NO_BREAK = "\u00a0"
_CEILINGS = ("true_style",)  # told the true style: not a method one could use
_PRETRAINED = ("sim_pretrained", "sim_pretrained_context")  # not simpler: it knows simulated people
_SAME = (
    "mind_meld_paper",
    "mind_meld_paper_text",
    "auto",
    "no_labels",
)  # no simpler methods of mapping labels
_TIE = 0.01
_CI = f"95{_NARROW_SPACE}% CI"

_METHODS = {
    "identity": "labels as given",
    "no_labels": "the car's motion alone, no labels",
    "shared_gain": "one gain for all",
    "person_gain": "a gain per person",
    "person_gain_lag": "a gain and lag per person",
    "shared_ridge": "one linear window for all",
    "person_ridge": "a linear window per person",
    "no_embedding": "network without embedding",
    "mean_embedding": "MIND MELD with one embedding for all",
    "shuffled_embedding": "MIND MELD with shuffled embeddings",
    "mind_meld": "MIND MELD",
    "mind_meld_paper": "MIND MELD, the authors' settings",
    "mind_meld_paper_text": "MIND MELD, the paper's text",
    "eb_nonlinear": "a window per person, learned prior",
    "sim_pretrained": "pre-trained on simulated people",
    "sim_pretrained_context": "pre-trained, with the car's motion",
    "auto": "a blend chosen on held-out labels (auto)",
    "true_style": "network told the true style",
}
_LEARNERS = {
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


def method_name(method: str) -> str:
    """A method's key in words; an unknown key is shown as it is, without underscores."""
    return _METHODS.get(method, method.replace("_", " "))


def learner_name(key: str) -> str:
    """A learner's key in words, spelt as a learner or as a study's condition (``mind_meld``)."""
    known = _LEARNERS.get(key) or _LEARNERS.get(key.replace("_", "-"))
    return known or key.removeprefix("mapped:").replace("_", " ")


def percent(fraction: float) -> str:
    """A fraction as whole percent: 0.614 -> 61 %."""
    return f"{_signed(round(100.0 * fraction), '.0f')}{_NARROW_SPACE}%"


def percent_range(limits: tuple[float, float]) -> str:
    """Two fractions as a range: 55 to 67 %; it does not break over lines."""
    low, high = (_signed(round(100.0 * limit), ".0f") for limit in limits)
    return f"{low}{_NO_BREAK}to{_NO_BREAK}{high}{_NARROW_SPACE}%"


def decimal(value: float) -> str:
    """A number with two decimals."""
    return _signed(value, ".2f")


def count(value: int) -> str:
    """A whole number, thousands apart: 13 600."""
    return f"{value:,}".replace(",", _NARROW_SPACE)


def counted(many: int, what: str) -> str:
    """1 round, 12 rounds."""
    return f"{count(many)} {what}{'' if many == 1 else 's'}"


def duration(seconds: float) -> str:
    """A time as one says it: 45 s, 6.2 min, 1.3 h."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * length:
            return f"{seconds / length:.1f}{_NARROW_SPACE}{unit}"
    return f"{seconds:.0f}{_NARROW_SPACE}s"


def p_value(value: float) -> str:
    """A p-value as journals print it: ``.012``, or ``< .001``."""
    if value < 0.001:
        return f"<{_NO_BREAK}.001"
    return f"{value:.3f}".removeprefix("0") if value < 0.9995 else "1"


def teachers(people: int) -> str:
    """1 teacher, 34 teachers."""
    return counted(people, "teacher")


def headline(summary: Summary) -> str:
    """The main finding in one sentence, as far as its confidence interval carries it."""
    new = summary.splits["new"]
    value, (low, high) = new.improvement[MAPPER], new.ci95
    whom = f"{teachers(new.people)} it had never seen"
    interval = f"{_CI} {percent_range((low, high))}"
    if low > 0.0:
        return f"MIND MELD removed {percent(value)} of the label error of {whom} ({interval})"
    if high < 0.0:
        worse = f"{_CI} {percent_range((-high, -low))}"
        return (
            f"MIND MELD added {percent(-value)} to the label error of {whom} ({worse}): "
            f"the labels got worse"
        )
    return (
        f"MIND MELD had no clear effect on the label error of {whom}: {percent(value)} removed "
        f"({interval})"
    )


def comparison(summary: Summary) -> str:
    """How the best of the other methods did on new people; empty if there is none."""
    improvement = summary.splits["new"].improvement
    apart = (MAPPER, "identity", *_CEILINGS, *_PRETRAINED, *_SAME)
    sentences: list[str] = []
    if simpler := [method for method in improvement if method not in apart]:
        best = max(simpler, key=lambda method: improvement[method])
        ahead = improvement[MAPPER] - improvement[best]
        what = f"the best simpler method ({method_name(best)}) removed {percent(improvement[best])}"
        if ahead > _TIE:
            sentences.append(f"On the same labels {what}.")
        elif ahead < -_TIE:
            sentences.append(f"That is not the best result here: {what}.")
        else:
            sentences.append(f"A simpler method does about as well: {what}.")
    labels_only, with_motion = (improvement.get(method) for method in _PRETRAINED)
    if labels_only is not None:
        also = (
            ""
            if with_motion is None
            else f", and {percent(with_motion)} reading the car’s motion too"
        )
        sentences.append(
            f"A mapper pre-trained on simulated people, which goes beyond the paper, removed "
            f"{percent(labels_only)}{also}."
        )
    if (blended := improvement.get("auto")) is not None:
        sentences.append(
            f"What to use here is auto, a blend that is chosen on held-out labels: it removed "
            f"{percent(blended)}."
        )
    if (motion := improvement.get("no_labels")) is not None and with_motion is not None:
        sentences.append(
            f"The car’s motion alone, without any label, removes {percent(motion)}: the robot "
            f"gives so much of the truth away, and what reads the motion gains from that too."
        )
    return " ".join(sentences)


def left_out_reasons(left_out: Mapping[str, str]) -> list[tuple[str, list[str]]]:
    """Reasons for which methods were not judged, each with the methods' keys."""
    reasons: dict[str, list[str]] = {}
    for method, why in left_out.items():
        reasons.setdefault(why, []).append(method)
    return list(reasons.items())


def _signed(value: float, kind: str) -> str:
    text = format(value, kind)
    if float(text) == 0.0:
        return text.lstrip("-")
    return text.replace("-", _MINUS)
