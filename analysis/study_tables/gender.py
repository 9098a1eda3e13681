"""Does w differ between women and men? The paper's t test as Welch's, and the whole of w at once."""

from typing import Any

import numpy as np

from steerlab.analysis.statistics.corrections import holm
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.two_groups import hotelling_t2, welch_t
from steerlab.analysis.study_data.records import Embeddings, StudyData
from steerlab.analysis.study_tables.plain import empty, plain
from steerlab.sim.seeds import rng_for

GROUPS = ("woman", "man")


def gender(data: StudyData, embeddings: Embeddings, *, seed: int, permutations: int) -> Any:
    """Permutation Hotelling T² (primary), and Welch's t of each dimension, Holm over dimensions.

    Other answers than woman and man are too few to compare; they are counted.
    """
    told = {
        person.id: str(person.answers["demographics"]["gender"])
        for person in data.people
        if "gender" in person.answers.get("demographics", {})
    }
    people = tuple(one for one in embeddings.people if told.get(one) in GROUPS)
    counts = {
        name: sum(told.get(one) == name for one in embeddings.people)
        for name in sorted({told[one] for one in embeddings.people if one in told})
    }
    untold = sum(one not in told for one in embeddings.people)
    if not people:
        return empty("nobody who has w told their gender as woman or man")
    w = embeddings.of(people)
    women = np.array([told[one] == GROUPS[0] for one in people])
    rng = rng_for(seed, "gender")
    each = [welch_t(column[women], column[~women]) for column in w.T]
    adjusted = iter(
        holm(np.array([one.p for one in each if not isinstance(one, NotComputable)])).tolist()
    )
    return {
        "groups": list(GROUPS),
        "counts": counts,
        "not_told": untold,
        "primary": plain(hotelling_t2(w, women, rng=rng, permutations=permutations)),
        "welch": [
            {"dimension": number, "test": plain(one), "holm": plain(one)}
            if isinstance(one, NotComputable)
            else {"dimension": number, "test": plain(one), "holm": plain(next(adjusted))}
            for number, one in enumerate(each, start=1)
        ],
    }
