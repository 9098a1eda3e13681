"""The page of an analysis: self-contained, its figures described, its deviations said plainly."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from steerlab.analysis.study_tables.deviations import deviations
from steerlab.analysis.study_tables.methods import methods_text, reproducibility
from steerlab.analysis.study_tables.reading import Reader
from steerlab.analysis.study_tables.report import AnalysisReport, render_analysis
from steerlab.analysis.study_tables.tables import AnalysisConfig, analyse
from steerlab.analysis.wording import p_value


class _Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.images: list[dict[str, str | None]] = []
        self.links: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if tag == "img":
            self.images.append(values)
        self.links += [values[key] for key in ("href", "src") if values.get(key)]
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(whole) -> str:
    return render_analysis(
        AnalysisReport(
            analysis=whole,
            versions={"steerlab": "9.9"},
            seconds={"tables": 1.0},
            command="steerlab analyze study",
            files=("table1.csv",),
        )
    )


def test_it_needs_no_other_file_and_describes_its_figures(page):
    found = _Page(page)
    assert found.open == []
    assert len(found.images) == 5
    assert all(one["alt"] and one["src"].startswith("data:image/svg+xml") for one in found.images)
    assert all(link.startswith("data:") for link in found.links)
    assert "prefers-color-scheme: dark" in page
    assert "@media print" in page


def test_it_says_verdicts_versions_and_the_plans_hash(page):
    assert "H1, H2a, H3a, H3b, H4 supported; H2b, H2c not supported." in page
    assert "steerlab 9.9" in page
    assert "SHA-256 " + "ab" * 32 in page
    assert "paper-compatible" in page.lower()


def test_figures_are_only_drawn_where_there_is_something_to_draw(study):
    data = replace(study(12), embeddings=(), held_out=())
    text = render_analysis(
        AnalysisReport(
            analysis=analyse(data, AnalysisConfig(permutations=99)),
            versions={},
            seconds={},
            command="x",
            files=(),
        )
    )
    assert len(_Page(text).images) == 1  # everyone's style


def test_as_planned_nothing_deviates(study, make_plan):
    data = replace(study(12), plan=make_plan())
    rows = [
        row
        for row in analyse(data, AnalysisConfig(permutations=99)).tables["hypotheses"]
        if row["planned"]
    ]
    assert deviations(data, rows) == []


def test_each_deviation_is_said(study, make_plan):
    first = make_plan().hypotheses[0]
    plan = make_plan(
        hypotheses=(
            replace(first, outcome="something else"),
            replace(first, id="H9", text="People are nice."),
        ),
        exclusions=("Whoever is over 90 is left out.",),
        amendments=("Version 2 of the protocol was recorded on Monday: a typo",),
        sha256=None,
    )
    data = replace(study(12), plan=plan, held_out=())
    found = "\n".join(
        deviations(data, analyse(data, AnalysisConfig(permutations=99)).tables["hypotheses"])
    )
    for said in (
        "not frozen",
        "Version 2",
        "H9 is planned (People are nice.) and this steerlab has no test for it",
        "H2a, H2b, H2c, H3a, H3b, H4 were not planned",
        "H1: the plan words its outcome as “something else”",
        "H1 was planned and could not be tested: no network was trained without",
        "“Whoever is over 90 is left out.”",
        "which the plan does not say",
    ):
        assert said in found
    assert "no analysis plan" in deviations(replace(data, plan=None), [])[0]


def test_the_plans_outcome_chooses_the_metric_and_its_alpha_the_level(study, make_plan, tables_of):
    data = study(14)
    planned = tables_of(replace(data, plan=make_plan(alpha=0.01, correction="none")))
    found = {row["id"]: row for row in planned["hypotheses"]}
    assert found["H3b"]["parts"][0]["key"] == "lag_plain_s"
    assert {row["alpha"] for row in found.values()} == {0.01}
    assert found["H1"]["p_corrected"] == found["H1"]["p"]
    free = {row["id"]: row for row in tables_of(data)["hypotheses"]}
    assert free["H3b"]["parts"][0]["key"] == "lag_s"


def test_the_methods_say_who_and_how(whole):
    text = " ".join(text for _, text in methods_text(whole))
    assert "Of 24 scripted participants, 20 training and 4 test" in text
    assert "499 permutations" in text
    assert "primary H1, H3a, H3b" in text
    assert "SHA" not in text  # hashes and versions stand at the end
    end = reproducibility(whole, {"steerlab": "1.2", "scipy": "3.4"})
    assert "steerlab 1.2, scipy 3.4" in end
    assert "SHA-256 " + "ab" * 32 in end


def test_numbers_as_journals_print_them():
    assert p_value(0.0123) == ".012"
    assert p_value(0.99999) == "1"
    assert p_value(1e-9).startswith("<")
    read = Reader()
    assert read.p(0.0123) == "p\u00a0=\u00a0.012"
    assert read.p(1e-9) == "p\u00a0<\u00a0.001"
    assert "so" in read.number({"empty": "so"})
    assert read.interval([-0.5, 0.25]) == "\u22120.50\u00a0to\u00a00.25"
    assert re.search("–", read.number(None))
