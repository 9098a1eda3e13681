"""Numbers and findings in words."""

from dataclasses import replace

import pytest

from steerlab.analysis.summary import Summary
from steerlab.analysis.wording import (
    comparison,
    count,
    decimal,
    headline,
    left_out_reasons,
    percent,
    percent_range,
    teachers,
)


def plain(text: str) -> str:
    return text.replace("\u202f", " ").replace("\u00a0", " ")


@pytest.mark.parametrize(
    ("fraction", "words"),
    [(0.614, "61 %"), (0.0, "0 %"), (-0.004, "0 %"), (-0.05, "−5 %"), (-445.52, "−44552 %")],
)
def test_percent(fraction: float, words: str):
    assert plain(percent(fraction)) == words


def test_other_numbers():
    assert plain(percent_range((-0.04, 0.091))) == "−4 to 9 %"
    assert (decimal(0.615), decimal(-0.001), decimal(-1.5)) == ("0.61", "0.00", "−1.50")
    assert plain(count(1234567)) == "1 234 567"
    assert (teachers(1), teachers(34)) == ("1 teacher", "34 teachers")


def with_new(summary: Summary, *, ci95: tuple[float, float], **improvement: float) -> Summary:
    improvement = {**summary.splits["new"].improvement, **improvement}
    seen = replace(summary.splits["seen"], improvement=improvement)
    new = replace(summary.splits["new"], improvement=improvement, ci95=ci95)
    return replace(summary, splits={"seen": seen, "new": new})


@pytest.mark.parametrize(
    ("value", "ci95", "words"),
    [
        (
            0.614,
            (0.55, 0.67),
            "MIND MELD removed 61 % of the label error of 34 teachers it had never seen "
            "(95 % CI 55 to 67 %)",
        ),
        (
            -0.12,
            (-0.2, -0.05),
            "MIND MELD added 12 % to the label error of 34 teachers it had never seen "
            "(95 % CI 5 to 20 %): the labels got worse",
        ),
        (
            0.03,
            (-0.04, 0.09),
            "MIND MELD had no clear effect on the label error of 34 teachers it had never seen: "
            "3 % removed (95 % CI −4 to 9 %)",
        ),
    ],
)
def test_the_headline_says_no_more_than_the_interval(
    summary: Summary, value: float, ci95: tuple[float, float], words: str
):
    assert plain(headline(with_new(summary, ci95=ci95, mind_meld=value))) == words


@pytest.mark.parametrize(
    ("baseline", "start"),
    [
        (0.35, "On the same labels the best simpler method (a gain per person) removed 35 %"),
        (0.61, "A simpler method does about as well: the best simpler method (a gain per person)"),
        (0.70, "That is not the best result here: the best simpler method (a gain per person)"),
    ],
)
def test_a_better_baseline_is_not_kept_quiet(summary: Summary, baseline: float, start: str):
    changed = with_new(summary, ci95=(0.5, 0.7), mind_meld=0.61, person_gain=baseline)
    assert plain(comparison(changed)).startswith(start)


def test_a_pre_trained_mapper_is_no_simpler_method(summary: Summary):
    summary = replace(summary, left_out={})
    ours = {"ci95": (0.5, 0.7), "mind_meld": 0.61, "person_gain": 0.35}
    alone = comparison(with_new(summary, **ours, mind_meld_paper=0.7))
    said = comparison(with_new(summary, **ours, mind_meld_paper=0.7, sim_pretrained=0.9))
    assert said.startswith(alone)
    assert plain(said).endswith("which goes beyond the paper, removed 90 %.")
    both = with_new(summary, **ours, sim_pretrained=0.9, sim_pretrained_context=0.95)
    assert plain(comparison(both)).endswith("90 %, and 95 % reading the car’s motion too.")


def test_methods_left_out_for_one_reason_are_named_together():
    assert left_out_reasons({"a": "why", "b": "other", "c": "why"}) == [
        ("why", ["a", "c"]),
        ("other", ["b"]),
    ]


def test_a_ceiling_is_no_baseline(summary: Summary):
    with_ceiling = with_new(summary, ci95=(0.5, 0.7), true_style=0.9)
    assert comparison(with_ceiling) == comparison(summary)
    only = {name: {"identity": 0.0, "mind_meld": 0.6} for name in ("seen", "new")}
    alone = replace(
        summary,
        splits={
            name: replace(split, improvement=only[name]) for name, split in summary.splits.items()
        },
    )
    assert comparison(alone) == ""
