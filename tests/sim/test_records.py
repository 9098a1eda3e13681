"""``LabelledStep`` and its plain rows and tables."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.records import (
    COLUMNS,
    LABELLED_STEP_SCHEMA,
    Driver,
    InvalidRecord,
    LabelledStep,
    row_from_step,
    step_from_row,
    table_from_columns,
    table_from_steps,
)

finite = st.floats(allow_nan=False, allow_infinity=False)
counts = st.integers(0, 2**31 - 1)
names = st.text(min_size=1, max_size=12).filter(lambda text: text.isprintable() and text.strip())

labelled_steps = st.builds(
    LabelledStep,
    participant=names,
    rollout=names,
    attempt=counts,
    step=counts,
    **{
        field.name: finite
        for field in LABELLED_STEP_SCHEMA
        if str(field.type) == "double" and not field.nullable
    },
    teacher_label=st.none() | finite,
    oracle_label=st.none() | finite,
    gate=st.sampled_from(Driver),
    label_valid=st.booleans(),
)

STEP = LabelledStep(
    participant="P01",
    rollout="calibration-00",
    attempt=0,
    step=3,
    t_s=0.3,
    x_m=1.0,
    y_m=-2.0,
    heading_rad=0.1,
    speed_mps=5.0,
    lateral_speed_mps=0.0,
    yaw_rate_radps=0.0,
    acceleration_x_mps2=0.0,
    acceleration_y_mps2=0.0,
    robot_wheel=0.5,
    teacher_label=None,
    oracle_label=1.0,
    executed_wheel=0.5,
    gate=Driver.ROBOT,
    label_valid=True,
)


@given(labelled_steps)
def test_a_row_turns_back_into_its_step(step: LabelledStep):
    row = row_from_step(step)
    assert tuple(row) == COLUMNS
    assert step_from_row(row) == step
    assert isinstance(step_from_row(row).gate, Driver)


@given(st.lists(labelled_steps, max_size=5))
def test_a_table_turns_back_into_its_steps(steps: list[LabelledStep]):
    table = table_from_steps(steps)
    assert table.schema.equals(LABELLED_STEP_SCHEMA, check_metadata=True)
    assert [step_from_row(row) for row in table.to_pylist()] == steps


def test_numpy_scalars_become_plain_values():
    step = replace(
        STEP,
        step=np.int64(7),
        x_m=np.float32(0.5),
        teacher_label=np.float64(1.25),
        label_valid=np.bool_(False),
    )
    row = row_from_step(step)
    assert [type(row[name]) for name in ("step", "x_m", "teacher_label", "label_valid")] == [
        int,
        float,
        float,
        bool,
    ]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", [f.name for f in LABELLED_STEP_SCHEMA if str(f.type) == "double"])
def test_a_number_that_is_not_finite_is_refused(name: str, bad: float):
    with pytest.raises(InvalidRecord, match=f"{name} is"):
        row_from_step(replace(STEP, **{name: bad}))


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("participant", ""),
        ("participant", "  "),
        ("participant", "two\nlines"),
        ("participant", "\ud800"),
        ("participant", None),
        ("rollout", 7),
        ("step", -1),
        ("step", 2**31),
        ("step", 1.5),
        ("attempt", "one"),
        ("x_m", None),
        ("x_m", "here"),
        ("gate", "pilot"),
    ],
)
def test_a_field_out_of_its_range_is_refused(name: str, bad: object):
    with pytest.raises(InvalidRecord, match=name):
        row_from_step(replace(STEP, **{name: bad}))


def test_a_row_names_what_is_missing_and_unknown():
    row = row_from_step(STEP)
    row["wheel"] = row.pop("robot_wheel")
    with pytest.raises(InvalidRecord, match=r"missing \['robot_wheel'\], unknown \['wheel'\]"):
        step_from_row(row)


def test_label_valid_is_a_truth_value():
    row = row_from_step(STEP)
    assert step_from_row({**row, "label_valid": 1}).label_valid is True
    with pytest.raises(InvalidRecord, match="label_valid"):
        step_from_row({**row, "label_valid": "yes"})


def test_columns_make_the_same_table_as_steps():
    steps = [STEP, replace(STEP, step=4, oracle_label=None)]
    rows = [row_from_step(step) for step in steps]
    columns = {name: [row[name] for row in rows] for name in COLUMNS}
    assert table_from_columns(columns).equals(table_from_steps(steps))
