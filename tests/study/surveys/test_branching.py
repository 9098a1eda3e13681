"""Items that are shown only after an answer, random orders, attention checks, and fingerprints."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.errors import InvalidValue
from steerlab.study.item_orders import drawn_order
from steerlab.study.surveys.answer_format import Choice, FreeText, Likert, Number, Option
from steerlab.study.surveys.branching import ShownIf
from steerlab.study.surveys.questionnaire import Item, Questionnaire, Scale
from steerlab.study.surveys.questionnaire_file import (
    questionnaire_from_toml,
    shipped_questionnaires,
)
from steerlab.study.surveys.scoring import keyed, score

FIVE = Likert(low=1, high=5, anchors=((1, "no"), (5, "yes")))
YES_NO = Choice(options=(Option(value="yes", text="Yes"), Option(value="no", text="No")))
BEFORE_BRANCHING = {  # as the version before branching, orders, languages and checks made them
    "demographics": "eae20eaa34ca7ae85367355e6cf7f6780a91d1b2d3cc0d8470b3374fad10f85d",
    "experience_driving": "3d83f80628306f19f30bbf82fe465e8aed8269ddfb4afbdce4bde47cd0d64d21",
    "experience_games": "71c763568b66fba770e2dfe90597989271381f6b237140595452c1577e5f037f",
    "experience_sim_driving": "4da80fde9bc60475184b18b38ef2f2a9704fa6f5f2af5da1eafc869fe446e9b1",
    "fluency": "a68f2a587140cd1aab666c761156644b5d0fe4002de4bcf38e58675ad9c89f8b",
    "mini_ipip_5": "6fcf5b327fa01135669695eee2b1e96431004289b4a28d59b33553f0f43d50b3",
    "mini_ipip_7": "6148038dcf9894e69e67b8bd23cee3145625f76de18806c3e61ce0da9c3b6f92",
    "raw_tlx": "692a28efa3fc493ccb681d22e1d116c9cc4c4a94bf62ce225aaa5bad37c0db4e",
    "trust": "c066fcb6462d54af5da94c12511fb7de6d77c6f5d76200c5dfda84fb31c4654b",
}


@pytest.fixture
def branched() -> Questionnaire:
    """played -> hours (if yes) -> tired (after many hours); calm and check always."""
    return Questionnaire(
        key="branched",
        title="Branched",
        version=1,
        instructions="Answer.",
        citation="Ours.",
        licence_note="Ours.",
        unvalidated=True,
        items=(
            Item(id="played", text="Played?", format=YES_NO),
            Item(
                id="hours",
                text="Hours?",
                format=Number(minimum=0, maximum=100),
                shown_if=ShownIf(item="played", answers=("yes",)),
            ),
            Item(
                id="tired",
                text="Tired",
                format=FIVE,
                shown_if=ShownIf(item="hours", answers=(9, 10)),
            ),
            Item(id="calm", text="Calm", format=FIVE),
            Item(id="check", text="Choose 4", format=FIVE, attention=4),
        ),
        scales=(Scale(key="all", title="All", items=("tired", "calm"), reversed=("calm",)),),
    )


@pytest.mark.parametrize(
    ("answers", "shown", "missing"),
    [
        ({}, "played calm check", "played calm check"),
        ({"played": "no", "calm": 1}, "played calm check", "check"),
        ({"played": "yes"}, "played hours calm check", "hours calm check"),
        ({"played": "yes", "hours": 9}, "played hours tired calm check", "tired calm check"),
        ({"played": "no", "hours": 9, "tired": 2}, "played calm check", "calm check"),
        ({"hours": 9}, "played calm check", "played calm check"),
    ],
)
def test_an_item_is_shown_after_the_answer_it_depends_on(branched, answers, shown, missing):
    assert [item.id for item in branched.shown(answers)] == shown.split()
    assert branched.missing(answers) == missing.split()


def test_answers_to_hidden_items_do_not_count_nor_score(branched):
    given = {"played": "no", "hours": 9, "tired": 2, "calm": 1, "gone": 7}
    assert branched.counted(given) == {"played": "no", "calm": 1, "gone": 7}  # of an older version
    del given["gone"]
    assert keyed(branched, "all", given) == (None, 5)
    assert score(branched, given)["all"].reason == "not shown: tired"
    assert score(branched, {"played": "no"})["all"].reason == "no answer to calm; not shown: tired"
    assert score(branched, given | {"played": "yes"})["all"].score == 7.0


def _items(*changes: tuple[int, dict]):
    def change(parts: Questionnaire) -> tuple[Item, ...]:
        items = list(parts.items)
        for index, values in changes:
            items[index] = replace(items[index], **values)
        return tuple(items)

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            _items((1, {"shown_if": ShownIf(item="plaid", answers=("yes",))})),
            r"^items\[1\]\.shown_if\.item is 'plaid'; it must be an item before it \(played\); "
            r"there is no 'plaid'",
        ),
        (
            _items((1, {"shown_if": ShownIf(item="hours", answers=(3,))})),
            r"an item before it \(played\), not itself",
        ),
        (
            _items((0, {"shown_if": ShownIf(item="calm", answers=(3,))})),
            r"^items\[0\]\.shown_if\.item is 'calm'; .*\(there is none\); 'calm' comes later, so put "
            r"it before 'played'",
        ),
        (
            _items((1, {"shown_if": ShownIf(item="played", answers=("yes", "ja"))})),
            r"^items\[1\]\.shown_if\.is\[1\] is 'ja'; it must be an answer to 'played': one of yes, no",
        ),
        (
            _items((2, {"shown_if": ShownIf(item="hours", answers=("9",))})),
            r"^items\[2\]\.shown_if\.is\[0\] is '9'; .*a whole number from 0 to 100",
        ),
        (
            _items((0, {"format": FreeText()})),
            r"^items\[1\]\.shown_if\.item is 'played'; .*another kind than text",
        ),
    ],
)
def test_a_branch_that_leads_nowhere_is_named(branched, change, message):
    with pytest.raises(InvalidValue, match=message):
        replace(branched, items=change(branched))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ShownIf(item="a", answers=()), "^is is .*one or more answers"),
        (
            lambda: Item(id="a", text="A", format=FIVE, attention=6),
            "^attention is 6; .*from 1 to 5",
        ),
        (lambda: Item(id="a", text="A", format=FIVE, attention="4"), "^attention is '4'"),
        (lambda: Item(id="a", text="A", format=YES_NO, attention="maybe"), "one of yes, no"),
        (lambda: Item(id="a", text="A", format=FreeText(), attention="a"), "left out: who writes"),
    ],
)
def test_a_rule_that_cannot_hold_is_refused(make, message):
    with pytest.raises(InvalidValue, match=message):
        make()


def test_an_attention_check_is_part_of_no_scale(branched):
    scale = Scale(key="s", title="S", items=("calm", "check"))
    with pytest.raises(InvalidValue, match=r"^scales\[0\]\.items is 'check'; .*without attention"):
        replace(branched, scales=(scale,))


@pytest.mark.parametrize(("key", "value"), [("order", "shuffled"), ("language", "fr")])
def test_an_unknown_order_or_language_is_refused(branched, key, value):
    with pytest.raises(InvalidValue, match=f"^{key} is '{value}'; it must be one of "):
        replace(branched, **{key: value})


@given(seed=st.integers(0, 2**32), participant=st.text(min_size=1, max_size=8))
def test_a_random_order_has_every_item_once_and_dependants_right_behind(seed, participant):
    items = tuple(
        Item(
            id=f"i{index}",
            text="I",
            format=FIVE,
            shown_if=ShownIf(item=f"i{parent}", answers=(1,)) if parent is not None else None,
        )
        for index, parent in enumerate([None, 0, None, 1, 0, None, None, 6])
    )
    asked = replace(shipped_questionnaires()["fluency"], items=items, scales=(), order="random")
    order = drawn_order(asked, seed=seed, participant=participant)
    assert sorted(order) == sorted(item.id for item in items)
    at = order.index("i0")
    assert order[at : at + 4] == ("i0", "i1", "i3", "i4")
    assert order[order.index("i6") + 1] == "i7"
    assert order == drawn_order(asked, seed=seed, participant=participant)


def test_orders_differ_between_people_seeds_and_questionnaires_and_stay_forever():
    asked = replace(shipped_questionnaires()["fluency"], order="random")
    first = drawn_order(asked, seed=1, participant="P001")
    assert first == ("f2", "f1", "f3")
    people = {drawn_order(asked, seed=1, participant=f"P{number:03d}") for number in range(60)}
    assert len(people) == 6  # all orders of three
    seeds = {drawn_order(asked, seed=seed, participant="P001") for seed in range(60)}
    assert len(seeds) == 6
    keys = {
        drawn_order(replace(asked, key=f"k{number}"), seed=1, participant="P001")
        for number in range(60)
    }
    assert len(keys) == 6
    fixed = replace(asked, order="fixed")
    assert drawn_order(fixed, seed=7, participant="P001") == tuple(i.id for i in asked.items)


def test_questionnaires_of_before_keep_their_fingerprints():
    assert {
        key: one.fingerprint()
        for key, one in shipped_questionnaires().items()
        if not one.translates
    } == BEFORE_BRANCHING


def test_the_fingerprint_covers_every_new_key(branched):
    bare = replace(branched.items[3])
    made = [
        branched,
        replace(branched, order="random"),
        replace(branched, language="de"),
        replace(branched, translates="fluency"),
        replace(
            branched, items=(*branched.items[:3], bare, replace(branched.items[4], attention=3))
        ),
        replace(
            branched, items=(*branched.items[:3], bare, replace(branched.items[4], attention=None))
        ),
        replace(branched, items=_items((2, {"shown_if": None}))(branched)),
        replace(
            branched, items=_items((2, {"shown_if": ShownIf(item="hours", answers=(9,))}))(branched)
        ),
    ]
    assert len({one.fingerprint() for one in made}) == len(made)


FILE = """format = 1
key = "mine"
title = "Mine"
version = 1
unvalidated = true
order = "random"
language = "de"
instructions = "Bitte antworten."
citation = "Unsere."
licence_note = "Unsere."

[defaults]
kind = "likert"
low = 1
high = 5
anchors = { 1 = "nein", 5 = "ja" }

[[items]]
id = "one"
text = "Eins"

[[items]]
id = "two"
text = "Zwei"
shown_if = { item = "one", is = [4, 5] }

[[items]]
id = "check"
text = "Bitte 4 ankreuzen"
attention = 4
"""


def test_a_file_has_the_new_keys():
    found = questionnaire_from_toml(FILE, "mine.toml")
    assert (found.order, found.language) == ("random", "de")
    assert found.item("two").shown_if == ShownIf(item="one", answers=(4, 5))
    assert found.item("check").attention == 4


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        (
            'order = "random"',
            'order = "latin"',
            6,
            "order is 'latin'; it must be one of fixed, rand",
        ),
        ('language = "de"', 'language = "xx"', 7, "language is 'xx'; it must be one of en, de"),
        ('item = "one"', 'item = "eno"', 25, r"items\[1\]\.shown_if\.item is 'eno'; .*no 'eno'"),
        ("is = [4, 5]", "is = [4, 6]", 25, r"items\[1\]\.shown_if\.is\[1\] is 6; .*from 1 to 5"),
        ("is = [4, 5]", "is = 4", 25, r"shown_if\.is is 4; it must be a list"),
        ("is = [4, 5]", "is = [true]", 25, r"is\[0\] is True; it must be a text or a whole numb"),
        ("is = [4, 5]", "are = [4]", 25, r"shown_if\.are is .*one of the keys item, is"),
        ("attention = 4", "attention = 9", 30, r"items\[2\]\.attention is 9; .*from 1 to 5"),
        ("attention = 4", "attention = [4]", 30, r"items\[2\]\.attention is \[4\]; .*a text or a"),
        ("low = 1", "low = 1\nattention = 4", 15, "defaults.attention is 4; .*one of the keys"),
    ],
)
def test_what_is_wrong_in_a_file_is_named_with_its_line(old, new, line, message):
    assert old in FILE
    with pytest.raises(InvalidValue, match=message) as caught:
        questionnaire_from_toml(FILE.replace(old, new, 1), "mine.toml")
    assert caught.value.line == line
