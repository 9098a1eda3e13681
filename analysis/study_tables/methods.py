"""How a study was conducted and analysed, in publishable paragraphs."""

from collections import Counter
from collections.abc import Iterable, Mapping
from math import factorial

from steerlab.analysis.statistics.signed_rank_power import STUDIES
from steerlab.analysis.study_data.conduct import SCRIPTED, Conduct
from steerlab.analysis.study_data.records import StudyData
from steerlab.analysis.study_tables.constructs import style_rollouts
from steerlab.analysis.study_tables.sizes import ALPHA, BANDS, CORRELATIONS
from steerlab.analysis.study_tables.tables import Analysis
from steerlab.analysis.wording import counted, duration, learner_name

_NAMED = ("steerlab", "python", "numpy", "scipy", "torch")  # whose versions the text gives
_CORRECTIONS = {
    "holm": "Holm’s method",
    "bh": "Benjamini and Hochberg’s method",
    "none": "nothing",
}
_LIMITS = {
    "lateness_p99_ms": "99th percentile of lateness",
    "lateness_max_ms": "largest lateness",
    "dropped_share": "share of display frames left out",
    "overrun_share": "share of steps that overran",
    "input_age_p99_ms": "age of the device’s last event",
}


def methods_text(analysis: Analysis) -> list[tuple[str, str]]:
    """Title and text of each part of a methods section; parts without anything to say are left out."""
    data = analysis.data
    parts = [
        ("Participants", _participants(data)),
        ("Procedure", _procedure(data)),
        ("Devices and timing", _timing(data)),
        ("What was planned", _planned(data)),
        ("Style and scores", _measures(analysis)),
        ("Tests", _tests(analysis)),
        ("Small numbers", _small()),
    ]
    return [(title, text) for title, text in parts if text]


def reproducibility(analysis: Analysis, versions: Mapping[str, str]) -> str:
    """Versions, seed and the plan's hash: what it takes to make the same numbers again."""
    plan = analysis.data.plan
    used = ", ".join(f"{name} {versions[name]}" for name in _NAMED if name in versions)
    text = (
        f"Analyses were made with {used}; random numbers of permutations and resamples come from "
        f"seed {analysis.config.seed}."
    )
    if plan is None or plan.sha256 is None:
        return text
    return (
        f"{text} The analysis plan has SHA-256 {plan.sha256}, the protocol it was frozen with "
        f"{plan.protocol_sha256}."
    )


def _participants(data: StudyData) -> str:
    training, test = (len(data.of_role(role)) for role in ("training", "test"))
    scripted = [person.id for person in data.people if person.scripted]
    what = "scripted participants" if data.simulated else "participants"
    sentences = [
        f"Of {data.enrolled} {what}, {training} training and {test} test participants were analysed."
    ]
    if scripted and not data.simulated:
        sentences.append(
            f"{len(scripted)} of those analysed are scripts and no people ({', '.join(scripted)}); "
            f"every n and every number has them in it."
        )
    for kind, plural in (
        ("person", "Participants"),
        ("attempt", "Attempts"),
        ("teacher", "Teachers"),
    ):
        reasons = Counter(one.why for one in data.exclusions if one.what == kind)
        if reasons:
            sentences.append(f"{plural} left out: {_counts(reasons)}.")
    if not data.exclusions:
        sentences.append("Nobody and no attempt was left out.")
    return " ".join(sentences)


def _procedure(data: StudyData) -> str:
    conduct = data.conduct
    if conduct is None:
        drives = len({series.rollout for series in data.series})
        return (
            f"Every scripted teacher labelled the same {drives} recorded drives." if drives else ""
        )
    sentences: list[str] = []
    if conduct.rollouts:
        order = (
            "everyone in the same order, that of the protocol"
            if conduct.rollout_orders == 1
            else f"in {conduct.rollout_orders} different orders"
        )
        sentences.append(f"Participants corrected {conduct.rollouts} recorded drives, {order}.")
    if conduct.condition_orders:
        sentences.append(_orders(conduct))
    if conduct.phases:
        took = "; ".join(
            f"{one.title.lower()} {duration(one.median_s)} ({duration(one.shortest_s)} to "
            f"{duration(one.longest_s)}; {counted(one.times, 'time')})"
            for one in conduct.phases
        )
        sentences.append(f"Phases took, as median and range with breaks included: {took}.")
    if any(person.scripted for person in data.people):
        sentences.append("Durations of scripts say nothing and are not given.")
    return " ".join(sentences)


def _orders(conduct: Conduct) -> str:
    names = ", ".join(map(learner_name, conduct.conditions))
    blind = (
        "The experimenter was not shown which condition came when."
        if conduct.blind
        else "The experimenter could see which condition came when."
    )
    assigned = "; ".join(
        f"{many} × {', '.join(map(learner_name, order))}"
        for order, many in sorted(
            conduct.condition_orders.items(), key=lambda one: (-one[1], one[0])
        )
    )
    return (
        f"Test participants were to teach under {len(conduct.conditions)} conditions ({names}), "
        f"{counted(conduct.rounds, 'round')} each after a first drive. Their order of conditions is "
        f"one of all {factorial(len(conduct.conditions))}, drawn from seed {conduct.seed} in blocks "
        f"of {conduct.block_size} test participants in which each order comes equally often; the place of "
        f"who declines or withdraws is given to the next. {blind} Orders of those analysed: {assigned}."
    )


def _timing(data: StudyData) -> str:
    conduct = data.conduct
    if conduct is None or not conduct.devices:
        return ""
    rates = " and ".join(f"{rate:g}" for rate in conduct.control_hz)
    devices = {name: many for name, many in conduct.devices.items() if name != SCRIPTED}
    sentences = [f"Control steps came at {rates} Hz."]
    if devices:
        people = [person for person in data.people if not person.scripted]
        known = sum(person.latency_s is not None for person in people)
        sentences.append(
            f"People steered with: {_counts(devices, name_first=True)}. The latency from hand to sample "
            f"was measured for {known} of {len(people)} and subtracted from their lags; "
            f"the lags of the others contain it."
        )
    if SCRIPTED in conduct.devices:
        sentences.append(
            f"{counted(conduct.devices[SCRIPTED], 'script')} steered without any device; scripts are "
            f"never late."
        )
    if conduct.steps is not None:
        kept = conduct.steps
        sentences.append(
            f"Of {kept.steps} control steps of the attempts that count, half began within "
            f"{kept.late_p50_ms:.2g} ms of their deadline, 99 % within {kept.late_p99_ms:.2g} ms, the "
            f"latest after {kept.late_max_ms:.2g} ms; {kept.overruns} overran."
        )
    if data.flagged:
        broke = {_LIMITS.get(name, name): many for name, many in conduct.flags.items()}
        sentences.append(
            f"{len(data.flagged)} of {conduct.attempts} attempts broke a limit of timing "
            f"({_counts(broke, name_first=True)}) and count all the same; H3a and H3b without them "
            f"are given beside."
        )
    else:
        sentences.append(f"None of {conduct.attempts} attempts broke a limit of timing.")
    return " ".join(sentences)


def _planned(data: StudyData) -> str:
    plan = data.plan
    if plan is None:
        return "There was no analysis plan: every result is exploratory."
    ids = {True: [], False: []}
    for hypothesis in plan.hypotheses:
        ids[hypothesis.primary].append(hypothesis.id)
    what = "; ".join(
        f"{kind} {', '.join(ids[primary])}"
        for kind, primary in (("primary", True), ("secondary", False))
        if ids[primary]
    )
    frozen = (
        f"The analysis plan was frozen with version {plan.version} of the protocol on "
        f"{(plan.frozen_utc or '')[:10]}."
        if plan.sha256
        else "The analysis plan was not frozen."
    )
    return (
        f"{frozen} It names as hypotheses {what or 'none'}; alpha is {plan.alpha:g}, corrected by "
        f"{_CORRECTIONS[plan.correction]} over the primary ones, and apart from those over the others. "
        f"Whatever is not among them is exploratory; departures from the plan "
        f"are listed under their own heading."
    )


def _measures(analysis: Analysis) -> str:
    fast = " (fastdtw with radius 10 beside it)" if analysis.config.fastdtw else ""
    rollouts = style_rollouts(analysis.data)
    text = (
        f"Over- and under-correction is the signed amplitude metric of Eq. 3 of Schrum, Hedlund and "
        f"Gombolay along an exact dynamic time warping path{fast}; a true label of 0 counts any "
        f"input as over-correction. Delay is the mean lag along that path, and the median lag along "
        f"the path between both signals scaled to mean 0 and variance 1. Known device latencies were "
        f"subtracted. Cronbach’s alpha has Feldt’s interval; scales with a missing answer have no "
        f"score, and nothing was imputed."
    )
    if not rollouts:
        return text
    return (
        f"{text} Where style is compared with w, it was measured on the {counted(len(rollouts), 'drive')} "
        f"({', '.join(rollouts)}) that the network whose w it is was not fitted on, so that the noise of a "
        f"drive cannot be in both."
    )


def _tests(analysis: Analysis) -> str:
    return (
        f"The association of an embedding with one quantity is multiple R, which does not depend on "
        f"how the embedding is turned, with a p-value from {analysis.config.permutations} permutations "
        f"and an interval from the noncentral F distribution. Table 2’s family was corrected by Holm "
        f"and by Benjamini and Hochberg. The paper’s own rule (Pearson or Spearman after Shapiro-Wilk "
        f"and the non-constant variance score test) is reported per dimension and labelled "
        f"paper-compatible. Women and men were compared by a permutation Hotelling T² and by Welch’s t "
        f"of each dimension. Label errors were compared on rollouts that the network was not trained "
        f"on, by Wilcoxon’s signed ranks over people; the improvement is the share of the summed "
        f"absolute error removed, with a percentile bootstrap over people. Conditions were compared by "
        f"Friedman’s test, repeated-measures ANOVA with Greenhouse and Geisser’s correction and a "
        f"mixed model with a random intercept per person; pairs by Wilcoxon’s test with Holm’s "
        f"correction; success as yes or no by Cochran’s Q and McNemar’s exact test. Intervals are 95 %."
    )


def _small() -> str:
    return (
        f"A test whose smallest possible p is not below alpha, for the number of people and ties it "
        f"has and after correction, could not be significant whatever people did: its hypothesis "
        f"counts as not tested, not as unsupported. Power is that of the test that was used: of "
        f"Wilcoxon’s signed ranks from {STUDIES:,} simulated studies of normal differences with its "
        f"exact distribution (from 50 people on, that of the t test with 3/π as many people), of "
        f"multiple R by the F test; both at the strictest level that the corrections may ask for. "
        f"Correlations with w are shown from {CORRELATIONS} people on, Cronbach’s alpha from {ALPHA}, "
        f"bootstrap intervals from {BANDS}; below that the numbers are in the files alone."
    )


def _counts(counts: Mapping[str, int], *, name_first: bool = False) -> str:
    pairs: Iterable[tuple[str, int]] = sorted(counts.items(), key=lambda one: (-one[1], one[0]))
    form = "{0} ({1})" if name_first else "{1} {0}"
    return "; ".join(form.format(name, many) for name, many in pairs)
