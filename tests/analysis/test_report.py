"""The report: well-formed, self-contained, escaped, and every number the summary's."""

import base64
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from steerlab.analysis.mapper_report import (
    LabelsCaption,
    SimulationReport,
    ladder_of,
    render_report,
)
from steerlab.analysis.summary import InvalidSummary
from steerlab.analysis.wording import count, decimal, headline, percent, percent_range

VOID = {"meta", "img", "br", "link", "input", "hr"}
FORMS = {"count": count, "decimal": decimal, "percent": percent, "percent_range": percent_range}


class Page(HTMLParser):
    """Checks nesting while it reads, and keeps what the tests ask about."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.data: list[tuple[str, str, str]] = []
        self.words: list[str] = []
        self.titles: dict[str, list[str]] = {}
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(dict(attrs)) == len(attrs), f"<{tag}> repeats an attribute"
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "title"):
            self.words.append(data)
            self.titles.setdefault(self.open[-1], []).append(data.strip())
        if self.open and self.open[-1] == "data":
            attrs = self.tags[-1][1]
            self.data.append((str(attrs["data-key"]), str(attrs["value"]), data))

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", "".join(self.words))


@pytest.fixture(scope="module")
def html(report: SimulationReport) -> str:
    return render_report(report)


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def test_the_outline_is_as_agreed(page: Page):
    tags = Counter(tag for tag, _ in page.tags)
    assert (tags["h1"], tags["main"], tags["header"], tags["footer"]) == (1, 1, 1, 1)
    assert page.titles["h2"] == [
        "Results",
        "Is it more than a simple correction?",
        "One drive, and what the oracle would do",
        "One teacher’s labels, before and after",
        "Person by person",
        "What the embeddings hold",
        "How to read this",
        "What this does not show",
        "How this was made",
    ]
    assert tags["figure"] == tags["figcaption"] == tags["img"] == 5
    assert tags["table"] == tags["caption"] == 3
    assert dict(page.tags)["html"] == {"lang": "en"}
    assert tags["script"] == 0


def test_each_figure_is_described_and_is_a_picture(page: Page):
    for tag, attrs in page.tags:
        if tag == "img":
            assert len(attrs["alt"] or "") > 30
            kind, _, content = (attrs["src"] or "").partition(",")
            assert kind == "data:image/svg+xml;base64"
            svg = ElementTree.fromstring(base64.b64decode(content))
            assert svg.tag == "{http://www.w3.org/2000/svg}svg"
        if tag == "th":
            assert attrs["scope"] in ("row", "col")


def test_nothing_is_loaded_from_elsewhere(html: str, page: Page):
    loads = {"src", "href", "srcset", "action", "poster", "data", "xlink:href", "background"}
    for tag, attrs in page.tags:
        for name in loads & set(attrs):
            assert (attrs[name] or "").startswith("data:"), f"<{tag} {name}> loads {attrs[name]}"
    assert "url(" not in html
    assert "@import" not in html
    assert "http://" not in html
    assert "https://" not in html
    for tag, attrs in page.tags:
        if tag == "img":  # nor by the pictures themselves
            svg = base64.b64decode((attrs["src"] or "").partition(",")[2]).decode()
            links = re.findall(r'href="([^"]*)"', svg)
            assert all(link.startswith(("#", "data:")) for link in links)
    assert "default-src 'none'" in html
    assert len(html) < 3_000_000


def test_every_marked_number_is_the_summarys(report: SimulationReport, page: Page):
    values = report.summary.to_dict()
    seen_keys = set()
    for key, value, shown in page.data:
        expected: Any = values
        for part in key.split("."):
            expected = expected[part]
        seen_keys.add(key)
        plain = " ".join(map(str, expected)) if isinstance(expected, list) else str(expected)
        assert value == plain, key
        if key.endswith("per_sample_percent"):
            assert shown == percent(expected / 100.0)
        else:
            assert shown in {form(expected) for form in _forms_of(expected)}, key
    wanted = {
        f"splits.{split}.{name}" for split in ("seen", "new") for name in values["splits"]["new"]
    }
    wanted -= {"splits.seen.improvement", "splits.new.improvement"}
    wanted |= {f"splits.{s}.improvement.{m}" for s in ("seen", "new") for m in report.ladder_ci95}
    assert wanted <= seen_keys


def _forms_of(value: Any) -> list[Any]:
    if isinstance(value, list):
        return [percent_range]
    return [count] if isinstance(value, int) else [decimal, percent]


def test_no_number_stands_beside_the_summary(report: SimulationReport, page: Page):
    """Percentages outside marked data come from the headline, the intervals, or the wording."""
    marked = {shown for _, _, shown in page.data}
    known = " ".join([headline(report.summary), *marked])
    known += " ".join(
        percent_range(limits)
        for splits in report.ladder_ci95.values()
        for limits in splits.values()
    )
    # 95 % (of the intervals), 100 % and 0 % (what perfect and no change mean) belong to the text.
    for number in re.findall(r"−?\d+(?=\u202f%)", page.text):
        assert number in {"95", "100", "0"} or re.search(rf"(?<!\d){number}\b", known), number


def test_the_per_sample_figure_is_shown_once(page: Page):
    keys = Counter(key for key, _, _ in page.data)
    assert keys["splits.seen.per_sample_percent"] == keys["splits.new.per_sample_percent"] == 1


def test_headline_provenance_and_captions(report: SimulationReport, page: Page):
    assert page.titles["h1"] == [f"{headline(report.summary)}."]
    for words in (
        report.command,
        "torch 2.13.0",
        "fit 31.5 s",
        "Teacher new-07 (new to the mapper) labels calibration-11",
        f"{decimal(report.labels.mae_before)} before and {decimal(report.labels.mae_after)} after",
        "paths at 4.5 s and 12.0 s",
        "not measured",
        "not people",
    ):
        assert words in page.text


def test_hostile_names_are_text(report: SimulationReport, empty_figures: dict[str, Figure]):
    evil = "<script>alert('x')</script>\"><img src=http://evil.example/>"
    hostile = replace(
        report,
        command=evil,
        figures=empty_figures,
        drive=replace(report.drive, rollout=evil, world=evil, outcome=evil),
        labels=replace(report.labels, teacher=evil, split=evil, rollout=evil),
        summary=replace(report.summary, noise=evil, versions={evil: evil}, seconds={evil: 1.0}),
    )
    page = Page(render_report(hostile))
    tags = Counter(tag for tag, _ in page.tags)
    assert tags["script"] == 0
    assert tags["img"] == 5
    assert page.text.count("<script>alert('x')</script>") >= 8


def test_a_hostile_method_name_is_text(report: SimulationReport, empty_figures: dict[str, Figure]):
    evil = "<b>&x"
    splits = {
        name: replace(split, improvement={**split.improvement, evil: 0.9})
        for name, split in report.summary.splits.items()
    }
    changed = replace(
        report,
        figures=empty_figures,
        summary=replace(report.summary, splits=splits),
        ladder_ci95={**report.ladder_ci95, evil: {"seen": (0.8, 1.0), "new": (0.8, 1.0)}},
    )
    assert evil in Page(render_report(changed)).titles["th"]


def test_equal_reports_give_equal_pages(report: SimulationReport, html: str):
    assert render_report(report) == html


def test_a_picture_that_the_camera_did_not_take_is_said_to_be_left_out(
    report: SimulationReport, empty_figures: dict[str, Figure]
):
    drive = replace(report.drive, camera_t_s=None, oracle_moments_s=(1.0,))
    text = Page(render_report(replace(report, drive=drive, figures=empty_figures))).text
    assert "The camera’s frame is left out" in text
    assert "Beside it, the camera" not in text
    assert "paths at 1.0 s;" in text


def test_a_method_without_interval_is_refused(report: SimulationReport):
    with pytest.raises(InvalidSummary, match="'person_gain' has no interval for new people"):
        replace(
            report,
            ladder_ci95={**report.ladder_ci95, "person_gain": {"seen": (0.1, 0.2)}},
        )
    ladder = ladder_of(report.summary, report.ladder_ci95)
    assert ladder["mind_meld"]["new"] == (0.61383, *report.summary.splits["new"].ci95)


def test_label_errors_leave_out_steps_without_truth():
    nan = np.nan
    caption = LabelsCaption.of(
        teacher="t",
        split="new",
        rollout="r",
        raw=np.array([1.0, 5.0, nan, 2.0]),
        mapped=np.array([0.5, 5.0, 1.0, 0.0]),
        truth=np.array([0.0, nan, 1.0, 0.0]),
    )
    assert (caption.mae_before, caption.mae_after) == (1.5, 0.25)
    with pytest.raises(InvalidSummary, match="No step of 'r'"):
        LabelsCaption.of(
            teacher="t",
            split="new",
            rollout="r",
            raw=np.array([1.0]),
            mapped=np.array([1.0]),
            truth=np.array([nan]),
        )
