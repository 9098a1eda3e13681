"""Facts about scripted participants, such as an age: answers that no trait is behind."""

import numpy as np

from steerlab.study.surveys.answer_format import Choice, FreeText, Number, Value
from steerlab.study.surveys.questionnaire import Item

# 34 people: age 28 ± 11.9, 29.4 % women (the paper's Results). Other shares are rough guesses.
_AGE_MEAN_YEARS, _AGE_STD_YEARS, _YOUNGEST_YEARS = 28.0, 11.9, 18.0
_SHARES: dict[tuple[str, str], dict[str, float]] = {
    ("demographics", "gender"): {
        "woman": 0.29,
        "man": 0.67,
        "non_binary": 0.02,
        "prefer_not_to_say": 0.02,
    },
    ("demographics", "handedness"): {"right": 0.89, "left": 0.10, "both": 0.01},
    ("demographics", "driving_licence"): {"yes": 0.85, "no": 0.15},
    ("demographics", "vision"): {"none_needed": 0.52, "corrected": 0.45, "not_corrected": 0.03},
}


def scripted_fact(questionnaire: str, item: Item, rng: np.random.Generator) -> Value | None:
    """An answer to a choice, a number or a text; None leaves an optional text out.

    Of the shipped demographics they are plausible; anything else is answered evenly.
    """
    form = item.format
    if isinstance(form, Choice):
        names = [option.value for option in form.options]
        shares = _SHARES.get((questionnaire, item.id))
        weights = None if shares is None else [shares.get(name, 0.0) for name in names]
        return str(rng.choice(names, p=weights))
    if isinstance(form, Number):
        if (questionnaire, item.id) == ("demographics", "age"):
            above = _AGE_MEAN_YEARS - _YOUNGEST_YEARS
            age = _YOUNGEST_YEARS + rng.gamma(
                (above / _AGE_STD_YEARS) ** 2, _AGE_STD_YEARS**2 / above
            )
            return int(min(age, form.maximum))
        if form.whole:
            return int(rng.integers(int(np.ceil(form.minimum)), int(form.maximum), endpoint=True))
        return float(rng.uniform(form.minimum, form.maximum))
    if not isinstance(form, FreeText):
        raise TypeError(f"{item.id!r} is on a scale: {form}.")
    return "(scripted)"[: form.longest] if item.required else None
