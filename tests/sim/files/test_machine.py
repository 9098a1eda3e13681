"""What the system says of the machine, and what is said where it does not."""

import os
from pathlib import Path

import pytest

from steerlab.sim.files import machine
from steerlab.sim.files.machine import available_cores, cpu_model, load_average, worker_count


def test_cores_are_counted_on_every_system(monkeypatch):
    assert 1 <= available_cores() <= (os.cpu_count() or 1)
    monkeypatch.delattr(machine.os, "sched_getaffinity", raising=False)
    assert available_cores() == (os.cpu_count() or 1)
    monkeypatch.setattr(machine.os, "cpu_count", lambda: None)
    assert available_cores() == 1


@pytest.mark.parametrize(("system", "most"), [("linux", 100), ("darwin", 100), ("win32", 61)])
def test_windows_gets_no_more_processes_than_it_can_wait_for(system, most, monkeypatch):
    monkeypatch.setattr(machine.sys, "platform", system)
    assert worker_count(100, 1000) == most
    assert worker_count(100, 3) == 3


def test_no_load_average_is_none_and_no_number(monkeypatch):
    monkeypatch.delattr(machine.os, "getloadavg")
    assert load_average() is None


def test_the_processor_has_a_name_without_proc(monkeypatch):
    def missing(*_: object, **__: object) -> str:
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(Path, "read_text", missing)
    monkeypatch.setattr(machine.platform, "processor", lambda: "arm")
    assert cpu_model() == "arm"
