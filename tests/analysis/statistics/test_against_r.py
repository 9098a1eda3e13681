"""Equal to R to 1e-6: each value was made by the line of ``reference.R`` of the same name."""

import numpy as np
import pytest

from steerlab.analysis.statistics.corrections import benjamini_hochberg, holm
from steerlab.analysis.statistics.correlation import pearson, score_test, shapiro_wilk, spearman
from steerlab.analysis.statistics.mixed_model import mixed_model
from steerlab.analysis.statistics.multiple_correlation import multiple_correlation
from steerlab.analysis.statistics.omnibus import cochran_q, friedman, repeated_measures
from steerlab.analysis.statistics.paired import mcnemar, wilcoxon
from steerlab.analysis.statistics.two_groups import hotelling_t2, welch_t


def close(value):
    return pytest.approx(value, abs=1e-6, rel=1e-6)


def ends(interval):
    return (interval.low, interval.high)


@pytest.mark.parametrize(
    ("key", "data"),
    [("normal", "x"), ("skewed", "skewed"), ("small", "small_x"), ("likert", "likert_x")],
)
def test_shapiro_wilk(r_values, key, data):
    found, r = shapiro_wilk(r_values["data"][data]), r_values["shapiro"][key]
    assert found.statistic == close(r["w"])
    assert found.p == pytest.approx(r["p"], rel=1e-6)


PAIRS = {
    "even": ("x", "y"),
    "cone": ("cone", "cone_y"),
    "small": ("small_x", "small_y"),
    "ties": ("likert_x", "likert_y"),
}


@pytest.mark.parametrize("key", ["even", "cone", "small"])
def test_score_test_is_ncv_test(r_values, key):
    x, y = (r_values["data"][name] for name in PAIRS[key])
    found, r = score_test(x, y), r_values["score_test"][key]
    assert found.statistic == close(r["chi2"])
    assert found.p == pytest.approx(r["p"], rel=1e-6)


@pytest.mark.parametrize("key", ["even", "cone", "small"])
def test_pearson(r_values, key):
    x, y = (r_values["data"][name] for name in PAIRS[key])
    found, r = pearson(x, y), r_values["pearson"][key]
    assert found.r == close(r["r"])
    assert found.p == pytest.approx(r["p"], rel=1e-6)
    assert ends(found.interval) == close(tuple(r["interval"]))


@pytest.mark.parametrize("key", ["even", "ties", "small"])
def test_spearman(r_values, key):
    x, y = (r_values["data"][name] for name in PAIRS[key])
    found, r = spearman(x, y), r_values["spearman"][key]
    assert found.r == close(r["r"])
    assert found.p == pytest.approx(r["p"], rel=1e-6)
    assert found.p_from == ("exact" if key == "small" else "t")


def test_spearman_of_reversed_values(r_values):
    data, r = r_values["data"], r_values["spearman"]["small_reversed"]
    found = spearman(data["small_x"], -data["small_y"])
    assert (found.r, found.p) == close((r["r"], r["p"]))


def test_multiple_correlation(r_values, rng):
    data, r = r_values["data"], r_values["multiple"]
    found = multiple_correlation(data["embedding"], data["construct"], rng=rng, permutations=999)
    assert (found.r2, found.adjusted_r2) == close((r["r2"], r["adjusted_r2"]))
    assert found.f_p == pytest.approx(r["f_p"], rel=1e-6)


def test_welch(r_values):
    data, r = r_values["data"], r_values["welch"]
    found = welch_t(data["women"], data["men"])
    assert (found.t, found.freedom, found.p) == close((r["t"], r["freedom"], r["p"]))
    assert ends(found.interval) == close(tuple(r["interval"]))


def test_hotelling(r_values, rng):
    r = r_values["hotelling"]
    found = hotelling_t2(r_values["data"]["embedding"], np.arange(34) < 10, rng=rng)
    assert (found.t2, found.distance) == close((r["t2"], r["distance"]))


def test_corrections(r_values):
    p = r_values["data"]["p_values"]
    assert holm(p) == close(np.array(r_values["holm"]))
    assert benjamini_hochberg(p) == close(np.array(r_values["bh"]))


@pytest.mark.parametrize(("key", "data"), [("friedman", "scores"), ("friedman_ties", "rounded")])
def test_friedman(r_values, rng, key, data):
    found, r = friedman(r_values["data"][data], rng=rng), r_values[key]
    assert (found.statistic, found.p) == close((r["chi2"], r["p"]))
    assert found.w == close(r["chi2"] / (12 * 2))


def test_cochran_q_is_the_general_mantel_haenszel_test(r_values, rng):
    found, r = cochran_q(r_values["data"]["success"], rng=rng), r_values["cochran"]
    assert (found.statistic, found.p) == close((r["cmh"], r["p"]))
    assert found.statistic == close(r["q"])


def test_repeated_measures(r_values):
    found, r = repeated_measures(r_values["data"]["scores"]), r_values["repeated"]
    assert (found.statistic, found.p_uncorrected) == close((r["f"], r["p"]))
    assert (found.epsilon, found.p) == close((r["epsilon"], r["p_gg"]))
    assert found.partial_eta2 == close(r["partial_eta2"])


def test_wilcoxon(r_values):
    scores, r = r_values["data"]["scores"], r_values["wilcoxon"]
    found = wilcoxon(scores[:, 0], scores[:, 1])
    assert (found.v, found.p, found.shift) == close((r["v"], r["p"], r["shift"]))
    assert ends(found.interval) == close(tuple(r["interval"]))
    assert found.p_from == "exact"


def test_wilcoxon_with_ties(r_values):
    rounded, r = r_values["data"]["rounded"], r_values["wilcoxon_ties"]
    found = wilcoxon(rounded[:, 0], rounded[:, 1])
    assert (found.v, found.p) == close((r["v"], r["p"]))
    assert found.p_from == "normal"
    assert found.equal > 0


def test_mcnemar(r_values):
    success, r = r_values["data"]["success"], r_values["mcnemar"]
    found = mcnemar(success[:, 0], success[:, 2])
    assert (found.p, found.share) == close((r["p"], r["share"]))
    assert ends(found.share_interval) == close(tuple(r["interval"]))


def test_mcnemar_of_three_against_nine(r_values):
    first = np.repeat([1.0, 0.0, 1.0], [3, 9, 8])
    second = np.repeat([0.0, 1.0, 1.0], [3, 9, 8])
    found, r = mcnemar(first, second), r_values["mcnemar_3_of_12"]
    assert (found.p, found.share) == close((r["p"], r["share"]))
    assert ends(found.share_interval) == close(tuple(r["interval"]))


def _mixed(data, kind):
    condition = data[f"{kind}_condition"]
    columns = {
        "second": (condition == 2.0).astype(float),
        "third": (condition == 3.0).astype(float),
        "order": data[f"{kind}_order"],
    }
    return mixed_model(data[f"{kind}_y"], columns, data[f"{kind}_person"])


def test_mixed_model_is_lmer(r_values):
    found, r = _mixed(r_values["data"], "mixed"), r_values["mixed"]
    assert [one.estimate for one in found.coefficients] == close(r["coefficients"])
    assert [one.error for one in found.coefficients] == close(r["errors"])
    assert (found.person_sd, found.residual_sd) == close((r["person_sd"], r["residual_sd"]))


def test_mixed_model_has_the_p_values_of_lme(r_values):
    found, r = _mixed(r_values["data"], "mixed"), r_values["mixed"]
    assert [one.freedom for one in found.coefficients] == r["freedom"]
    assert [one.p for one in found.coefficients] == close(r["p"])
    statistic, between, within, p = found.joint_test(["second", "third"])
    assert (statistic, p) == close((r["condition_f"], r["condition_p"]))
    assert (between, within) == (2, 20)


def test_mixed_model_of_people_who_do_not_differ(r_values):
    found, r = _mixed(r_values["data"], "flat"), r_values["mixed_flat"]
    assert [one.estimate for one in found.coefficients] == close(r["coefficients"])
    assert [one.error for one in found.coefficients] == close(r["errors"])
    assert (found.person_sd, found.residual_sd) == close((r["person_sd"], r["residual_sd"]))
