"""Lab Streaming Layer: what is pushed is read back by an inlet of the same process."""

import json
import logging
import os
import sys
from time import perf_counter_ns

import pytest

from steerlab.app.cli import main
from steerlab.sim.errors import MissingPackage
from steerlab.study.contract import Role
from steerlab.study.recording import lsl
from steerlab.study.recording.lsl import LslMarkers, lsl_markers, study_source
from steerlab.study.store.audit import read_audit
from steerlab.study.study import Study

WAIT_S = 20.0
LOCAL = "[multicast]\nResolveScope = machine\n[log]\nlevel = -3\n"


@pytest.fixture(scope="module", autouse=True)
def pylsl(tmp_path_factory):
    """The library, which looks for streams on this machine alone."""
    settings = tmp_path_factory.mktemp("lsl") / "lsl_api.cfg"
    settings.write_text(LOCAL)
    os.environ["LSLAPICFG"] = str(settings)  # read once in a process, when it is first used
    try:
        return pytest.importorskip("pylsl", reason="the extra lsl is not installed")
    except RuntimeError as error:
        pytest.skip(f"pylsl finds no liblsl here: {error}")


@pytest.fixture
def streams(pylsl):
    """``streams(source)``: inlets of both streams, connected."""
    opened = []

    def connect(source: str):
        for name in (source, f"{source}-steps"):
            found = pylsl.resolve_byprop("source_id", name, 1, WAIT_S)
            if not found:
                pytest.skip("liblsl finds no stream on this machine: no multicast here")
            opened.append(pylsl.StreamInlet(found[0]))
            opened[-1].open_stream(WAIT_S)
        return opened[-2:]

    yield connect
    for inlet in opened:
        inlet.close_stream()


def pulled(inlet, count: int) -> list[tuple[object, float]]:
    return [inlet.pull_sample(WAIT_S) for _ in range(count)]


def test_phases_drives_and_steps_come_out_as_they_went_in(study, streams, run_scripted):
    who = study.enrol(Role.TRAINING).id
    source = study_source(study.folder)
    entries = read_audit(study._opened.store.connection.sqlite)
    assert source == f"steerlab-{entries[0].sha256[:16]}"
    with lsl_markers(source) as markers:
        inlets = streams(source)
        run_scripted(study, Role.TRAINING, 1, participant=who, markers=markers)
    store = study._opened.store
    attempts = store.attempts()
    count = sum(store.steps(attempt).num_rows for attempt in attempts)
    steps = [sample for sample, _ in pulled(inlets[1], count)]
    expected = [[a.order_index, k] for a in attempts for k in range(store.steps(a).num_rows)]
    assert steps == expected
    phases = [phase.id for phase, _ in study.participant(who).phases]
    marks = pulled(inlets[0], 2 * len(phases) + 3 * len(attempts))
    said = [json.loads(text) for (text,), _ in marks]
    assert [one["phase"] for one in said if one["mark"] == "phase_begin"] == phases
    assert [one["phase"] for one in said if one["mark"] == "phase_end"] == phases
    assert {one["how"] for one in said if one["mark"] == "phase_end"} == {"done"}
    begun = [one for one in said if one["mark"] == "drive_begin"]
    assert [one["rollout"] for one in begun] == [attempt.rollout for attempt in attempts]
    assert begun[0] == {
        "mark": "drive_begin",
        "participant": who,
        "rollout": attempts[0].rollout,
        "attempt": 0,
        "order": 0,
        "control_hz": 20.0,
        "device": "scripted-human-1",
    }
    times = [at_s for _, at_s in marks]
    assert times == sorted(times)


def test_a_mark_bears_the_time_at_which_it_happened(pylsl, streams):
    """Not that at which it is pushed: here it happened two seconds before."""
    with lsl_markers("steerlab-test-times") as markers:
        inlets = streams("steerlab-test-times")
        before_s = pylsl.local_clock()
        at_ns = perf_counter_ns() - 2_000_000_000
        markers.mark("event", at_ns, what="paused", step=3)
        markers.step(4, 7, at_ns)
        after_s = pylsl.local_clock()
        (text,), marker_s = inlets[0].pull_sample(WAIT_S)
        step, step_s = inlets[1].pull_sample(WAIT_S)
    assert json.loads(text) == {"mark": "event", "what": "paused", "step": 3}
    assert step == [4.0, 7.0]
    for at_s in (marker_s, step_s):
        assert before_s - 2.001 <= at_s <= after_s - 1.999


def test_streams_say_what_they_are(streams):
    with lsl_markers("steerlab-test-about"):
        markers, steps = (inlet.info(WAIT_S) for inlet in streams("steerlab-test-about"))
    assert (markers.name(), markers.type(), markers.channel_count()) == (lsl.MARKERS, "Markers", 1)
    assert (steps.name(), steps.type(), steps.channel_count()) == (lsl.STEPS, "ControlSteps", 2)
    assert {markers.nominal_srate(), steps.nominal_srate()} == {0.0}
    assert "<label>order</label>" in steps.as_xml()


def test_a_library_that_fails_is_told_once_and_nothing_is_raised(caplog):
    class Broken:
        def push_sample(self, sample, at_s):
            raise RuntimeError("out of memory")

        def have_consumers(self):
            return False

    markers = LslMarkers("steerlab-test-broken")
    markers._markers = markers._steps = Broken()
    with caplog.at_level(logging.WARNING):
        for step in range(3):
            markers.step(0, step, perf_counter_ns())
            markers.mark("event", perf_counter_ns(), what="x", step=step)
        markers.close()
        markers.close()
    (told,) = caplog.messages
    assert told.startswith("Markers are no longer sent: out of memory.")


@pytest.mark.parametrize("error", [ImportError("no module"), RuntimeError("no liblsl")])
def test_without_the_library_it_is_said_in_a_sentence(folder, monkeypatch, capsys, error):
    class Missing:
        def find_spec(self, name, path=None, target=None):
            if name == "pylsl":
                raise error

    monkeypatch.delitem(sys.modules, "pylsl", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Missing(), *sys.meta_path])
    with pytest.raises(MissingPackage):
        LslMarkers("x")
    mend = "pip install 'steerlab[lsl]'" if isinstance(error, ImportError) else "PYLSL_LIB"
    for command in (
        ["study", "run", str(folder), "--teacher", "scripted:human:1", "--lsl"],
        ["drive", "--device", "keyboard", "--lsl"],
        ["correct", str(folder), "--participant", "P01", "--lsl"],
    ):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert mend in said
        assert said.count("\n") == 1
    with Study.open(folder) as study:
        assert study.participants() == []


def test_the_command_hands_the_markers_on(folder, monkeypatch, capsys):
    told = []

    class Listener:
        def __init__(self, source):
            told.append(source)

        def mark(self, what, at_ns, /, **details):
            told.append(what)

        def step(self, order, step, at_ns):
            pass

        def close(self):
            told.append("closed")

    monkeypatch.setattr(lsl, "LslMarkers", Listener)
    command = ["study", "run", str(folder), "--teacher", "scripted:human:1"]
    assert main([*command, "--no-recordings", "--lsl"]) == 0
    assert told[0].startswith("steerlab-")
    assert told[-1] == "closed"
    assert told.count("drive_begin") == told.count("drive_end") == 2
    told.clear()
    assert main([*command, "--no-recordings"]) == 0
    assert told == []
