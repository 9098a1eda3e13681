"""Names that look like one."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.names import alike, appearance, both_shown


@pytest.mark.parametrize(
    "other",
    [
        "p 01",
        " P01",
        "P01\t",
        "P01\n",
        "P\u00a001",
        "P0\u200b1",
        "\ufeffP01",
        "P\uff101",
        "p01\u00ad",
    ],
)
def test_blanks_case_and_unicode_form_do_not_tell_names_apart(other):
    assert alike(["P02", "P01", other]) == ("P01", other)


def test_other_differences_do():
    names = ["P01", "P1", "P-01", "P_01", "007", "7", "drive1", "drive2", "Jörg", "Jorg"]
    assert alike(names) is None
    assert alike(["P01", "P01"]) is None


def test_both_are_shown_so_that_they_differ():
    assert both_shown("P01", "p01") == "'P01' and 'p01' differ only by blanks, case or Unicode form"
    assert both_shown("J\u00f6rg", "Jo\u0308rg").startswith("'J\\xf6rg' and 'Jo\\u0308rg' differ")
    assert both_shown("P01", "P01\u00a0").startswith("'P01' and 'P01\\xa0' differ")


@given(st.text())
def test_every_form_of_a_name_looks_like_it(name):
    for form in ("NFC", "NFD", "NFKC", "NFKD"):
        assert appearance(unicodedata.normalize(form, name)) == appearance(name)
    assert appearance(appearance(name)) == appearance(name)
