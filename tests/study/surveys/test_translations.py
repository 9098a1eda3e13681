"""Translations ask the same in other words, and count as what they translate."""

from pathlib import Path

import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.study.contract import PhaseKind, Role
from steerlab.study.planted_effects import PlantedEffect, check_effects, effects_on
from steerlab.study.progress import progress_of
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.scripted_answers import ScriptedRespondent
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study
from steerlab.study.surveys.answer_format import Choice, FreeText, Likert, Number, Slider
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.questionnaire_file import all_questionnaires, shipped_questionnaires

SHIPPED = shipped_questionnaires()
ENGLISH = sorted(key for key, one in SHIPPED.items() if not one.translates)
ASSETS = Path(__file__).parents[3] / "assets" / "questionnaires"


def _said(asked: Questionnaire) -> list[str]:
    """Every word that participants read."""
    said = [asked.title, asked.instructions]
    for item in asked.items:
        said.append(item.text)
        match item.format:
            case Likert(anchors=anchors):
                said += [words for _, words in anchors]
            case Slider(low_label=low, high_label=high):
                said += [low, high]
            case Choice(options=options):
                said += [option.text for option in options]
            case Number(unit=unit):
                said.append(unit)
    return said


def _values(asked: Questionnaire, item: str) -> object:
    """What may be answered."""
    match asked.item(item).format:
        case Likert() as form:
            return form.low, form.high, [value for value, _ in form.anchors]
        case Slider() as form:
            return form.low, form.high, form.step
        case Choice() as form:
            return [option.value for option in form.options]
        case Number() as form:
            return form.minimum, form.maximum, form.whole
        case FreeText() as form:
            return form.longest


def test_every_questionnaire_is_there_in_german():
    assert set(SHIPPED) == {*ENGLISH, *(f"{key}_de" for key in ENGLISH)}


@pytest.mark.parametrize("key", ENGLISH)
def test_the_german_one_asks_the_same_in_other_words(key):
    english, german = SHIPPED[key], SHIPPED[f"{key}_de"]
    assert (german.translates, german.original, german.language) == (key, key, "de")
    assert german.form == english.form
    assert german.scales == english.scales
    for one, other in zip(english.items, german.items, strict=True):
        assert (one.id, one.kind, one.required) == (other.id, other.kind, other.required)
        assert _values(english, one.id) == _values(german, other.id)
    pairs = list(zip(_said(english), _said(german), strict=True))
    assert [one for one, other in pairs if one == other] == []


@pytest.mark.parametrize("key", ENGLISH)
def test_the_german_one_claims_no_validation(key):
    german = SHIPPED[f"{key}_de"]
    assert german.citation.startswith("Our own translation")
    assert german.unvalidated == bool(german.scales)  # facts measure nothing
    if german.scales:
        assert "not validated in German" in german.citation or "unvalidated" in german.citation


def _fill(study: Study, who: str, *kinds: PhaseKind) -> None:
    script = ScriptedParticipant(kind="human", seed=3)
    for kind in kinds:
        progress = progress_of(study._opened, who)
        phase = progress.of_kind(kind)
        assert phase is not None
        script.fill(study._opened, progress, phase)


def _new(folder: Path, change, language: str) -> Path:
    """The template's study; in German it names every questionnaire's translation."""
    new_study(folder, "mind-meld")
    if language == "de":
        change(folder, ("format = 1\n", 'format = 1\nlanguage = "de"\n'))
        file = folder / "study.toml"
        text = file.read_text()
        for key in ENGLISH:
            text = text.replace(f'"{key}"', f'"{key}_de"')
        file.write_text(text)
    return folder


def _answered(folder: Path) -> dict[str, dict]:
    """What a scripted participant answers on the first page, by questionnaire."""
    with Study.open(folder) as study:
        who = study.enrol(Role.TRAINING).id
        _fill(study, who, PhaseKind.CONSENT, PhaseKind.QUESTIONNAIRES)
        (page,) = [p for p, _ in study.participant(who).phases if p.id == "about-you"]
        return {key: dict(study.answers(who, page.id, key)) for key in page.questionnaires}


def test_a_german_mind_meld_study_is_accepted_and_scripts_answer_it(tmp_path, change):
    english = _answered(_new(tmp_path / "en", change, "en"))
    german = _answered(_new(tmp_path / "de", change, "de"))
    assert german == {f"{key}_de": given for key, given in english.items()}
    assert len(german["mini_ipip_5_de"]) == 20


def test_what_is_in_english_is_refused_with_the_german_key(tmp_path, change):
    new_study(tmp_path / "study", "mind-meld")
    change(tmp_path / "study", ("format = 1\n", 'format = 1\nlanguage = "de"\n'))
    with (
        Study.open(tmp_path / "study") as study,
        pytest.raises(InvalidConfig, match="such as demographics_de, or set"),
    ):
        study.enrol(Role.TRAINING)


def test_an_age_in_german_that_contradicts_the_consent_is_told(tmp_path, change):
    folder = _new(tmp_path / "study", change, "de")
    change(folder, ("[consent]\n", "[consent]\nminimum_age = 18\n"))
    with Study.open(folder) as study:
        who = study.enrol(Role.TRAINING).id
        _fill(study, who, PhaseKind.CONSENT)
        study.save_answer(who, "about-you", "demographics_de", "age", 17)
        (told,) = [check for check in study.findings(who) if "afterwards" in check.found]
        assert told.found == "said to be 18 or older, and 17 afterwards"


def test_success_and_planted_effects_move_a_translation_alike():
    german = SHIPPED["trust_de"]
    respondent = ScriptedRespondent("P001", None, 1)
    for success in (0.0, 1.0):
        assert respondent.answers(german, success=success) == respondent.answers(
            SHIPPED["trust"], success=success
        )
    effect = PlantedEffect(scale="trust.total", style="gain", correlation=0.5)
    check_effects([effect], {"trust_de": german})
    assert effects_on(german, [effect])["total"] == [effect]
    with pytest.raises(InvalidConfig, match="the study has trust"):
        check_effects([PlantedEffect(scale="x.y", style="gain", correlation=0.5)], {"a": german})


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("", "", None),
        ('translates = "fluency"', 'translates = "fluence"', "ours translates 'fluence'; name a"),
        ('translates = "fluency"', 'translates = "fluency_de"', "no translation itself"),
        ('language = "de"', 'language = "en"', "in another language than 'en'"),
        ("high = 7", "high = 8", "more than words"),
        ('reversed = ["f3"]', "reversed = []", "more than words"),
        ('id = "f1"', 'id = "f1"\nrequired = false', "more than words"),
        ('title = "Fluency"', 'title = "Zusammenspiel"', None),
    ],
)
def test_a_study_brings_translations_that_differ_in_words_alone(tmp_path, before, after, message):
    text = (ASSETS / "fluency_de.toml").read_text(encoding="utf-8")
    assert before in text
    text = text.replace('key = "fluency_de"', 'key = "ours"', 1).replace(before, after, 1)
    text = text.replace('7 = "', '8 = "Ganz"\n7 = "') if "8" in after else text
    (tmp_path / "ours.toml").write_text(text, encoding="utf-8")
    if message is None:
        assert all_questionnaires(tmp_path)["ours"].original == "fluency"
        return
    with pytest.raises(InvalidConfig, match=message):
        all_questionnaires(tmp_path)
