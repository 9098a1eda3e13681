"""Processes that share the work of a run which keeps what is finished."""

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.machine import worker_count


class WorkerLost(SteerlabError):
    """A process that worked has died: out of memory, or killed."""


@contextmanager
def worker_pool(
    jobs: int,
    tasks: int,
    initializer: Callable[..., None] | None = None,
    initargs: tuple[Any, ...] = (),
) -> Iterator[ProcessPoolExecutor]:
    """As many processes as ``jobs`` and ``tasks`` allow; the block hands out work and awaits it.

    Raises:
        WorkerLost: one died.
    """
    pool = ProcessPoolExecutor(
        max_workers=worker_count(jobs, tasks),
        mp_context=get_context("spawn"),  # a fork would share torch's and OpenGL's state
        initializer=initializer,
        initargs=initargs,
    )
    try:
        yield pool
    except BrokenProcessPool as error:
        raise WorkerLost(
            "A process that worked has died, for lack of memory or because it could not start. "
            "What was finished is kept: give the same command again, with fewer --jobs."
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
