"""The reports of ``fit`` and ``synthetic``: every number the summary's, nothing from elsewhere."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from steerlab.analysis.figures.synthetic import Demonstrators, ShownDrive, synthetic_figure
from steerlab.analysis.mapper_report import (
    FitReport,
    LabelFacts,
    SimulationReport,
    render_fit_report,
)
from steerlab.analysis.summary import InvalidSummary
from steerlab.analysis.synthetic_report import (
    SyntheticReport,
    SyntheticSummary,
    comparison_lines,
    render_synthetic_report,
)
from steerlab.sim.errors import InvalidConfig

EVIL = "<script>alert('x')</script>"


@pytest.fixture(scope="module")
def fit_report(report: SimulationReport) -> FitReport:
    return FitReport(
        summary=replace(report.summary, verb="fit"),
        ladder_ci95=report.ladder_ci95,
        command="steerlab fit labels.csv --out x",
        facts=LabelFacts(
            file="labels.csv",
            people=68,
            rollouts=816,
            labels=27_098,
            rates_hz=(20.0, 20.0),
            limit=2.5,
            folds=4,
            preset="lab",
            notices=("12 of 27110 rows lack label or truth and are masked.",),
        ),
        labels=report.labels,
        figures=dict.fromkeys(("labels", "ladder", "people"), Figure()),
    )


def test_a_fits_page_says_what_was_done(fit_report):
    page = render_fit_report(fit_report)
    assert page == render_fit_report(fit_report)
    for words in ("12 of 27110 rows", "dealt into 4 folds", "20 Hz", "of ±2.5", "labels.csv"):
        assert words in page
    assert "scaled back" not in page
    marked = re.findall(r'data-key="([^"]+)" value="([^"]*)"', page)
    values = fit_report.summary.to_dict()
    assert len(marked) > 20
    for key, shown in marked:
        value = values
        for part in key.split("."):
            value = value[part]
        plain = " ".join(map(str, value)) if isinstance(value, list) else str(value)
        assert shown == plain


def test_what_was_not_judged_is_said_with_its_reason(fit_report):
    page = render_fit_report(fit_report)
    assert "Not judged here" in page
    assert page.count("the quick ladder") == 1  # one reason, two methods
    for key in ("no_embedding", "mind_meld_paper"):
        assert f"<code>{key}</code>" in page
    whole = replace(fit_report, summary=replace(fit_report.summary, left_out={}))
    assert "Not judged here" not in render_fit_report(whole)
    evil = replace(fit_report, summary=replace(fit_report.summary, left_out={EVIL: EVIL}))
    assert "<script" not in render_fit_report(evil)


def test_the_files_own_split_and_range_are_told(fit_report):
    facts = replace(fit_report.facts, folds=None, limit=100.0, rates_hz=(10.0, 20.5))
    page = render_fit_report(replace(fit_report, facts=facts))
    for words in ("split column", "of ±100", "scaled back", "10 to 20.5 Hz"):
        assert words in page
    assert "None" not in page


def test_hostile_names_are_text(fit_report):
    facts = replace(fit_report.facts, file=EVIL, notices=(EVIL,))
    labels = replace(fit_report.labels, teacher=EVIL, rollout=EVIL)
    page = render_fit_report(replace(fit_report, facts=facts, labels=labels, command=EVIL))
    assert "<script" not in page
    assert "http" not in page.replace("http-equiv", "")


def _synthetic(report: SimulationReport) -> SyntheticReport:
    seen, new = (report.summary.splits[name] for name in ("seen", "new"))
    summary = SyntheticSummary(
        seed=3,
        versions={"torch": "2.13.0"},
        seconds={"fit": 20.0},
        splits={"calibration": seen, "unseen": seen, "new": new},
        style=report.summary.style,
        left_out={"sim_pretrained_context": "no motion"},
    )
    return SyntheticReport(
        summary=summary,
        interval={
            split: dict.fromkeys(one.improvement, one.ci95) for split, one in summary.splits.items()
        },
        command="steerlab synthetic --seed 3",
        wheel_per_rad=2.0 / np.pi,
        shift_s=0.3,
        magnitude=(1.1, 2.5),
        drive="calibration-00",
        figure2=Figure(),
    )


def test_the_synthetic_page_sets_both_definitions_beside_the_papers(report):
    page = render_synthetic_report(_synthetic(report))
    assert page == render_synthetic_report(_synthetic(report))
    assert "<code>sim_pretrained_context</code>:</b> no motion." in page
    for words in ("unstable", "not given", "one wheel unit is 90°", ">61\u202f%<", ">55\u202f%<"):
        assert words in page
    lines = comparison_lines(_synthetic(report).summary)
    assert lines[1].split() == ["calibration", "tasks", "62.7", "%", "-412.7", "%", "61", "%"]
    assert lines[3].endswith("-")
    with pytest.raises(InvalidSummary, match="calibration"):
        replace(_synthetic(report).summary, splits={})


def _people(count: int, seed: int) -> Demonstrators:
    rng = np.random.default_rng(seed)
    delay_s = 0.3 * (np.arange(count) % 3 - 1)
    names = {-1: "anticipatory", 0: "neither", 1: "delayed"}
    return Demonstrators(
        gain=np.exp(rng.normal(0.0, 0.5, count)),
        delay_s=delay_s,
        timing=[names[int(np.sign(one))] for one in delay_s],
        embeddings=rng.normal(size=(count, 2)),
    )


def test_figure_2_has_its_six_panels():
    t_s = np.arange(50) / 10.0
    wave = 40.0 * np.sin(t_s)
    shown = ShownDrive(
        t_s=t_s, truth_deg=wave, feedback_deg={"delayed": 2.0 * wave}, mapped_deg={"delayed": wave}
    )
    path = np.cumsum(np.ones((50, 2)), axis=0)
    figure = synthetic_figure([path], [path[-1]], shown, _people(9, 0), _people(4, 1))
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert [title[0] for title in titles] == list("abcdef")
    embedded = sum(len(points.get_offsets()) for points in figure.axes[5].collections)
    assert embedded == 9 + 4
    with pytest.raises(InvalidConfig, match="one each a person"):
        replace(_people(3, 0), timing=["delayed"])
