import os

import pytest

from steerlab.app.worker_pool import WorkerLost, worker_pool


def test_a_process_that_dies_is_said_in_words():
    with (
        pytest.raises(WorkerLost, match=r"has died.*fewer --jobs"),
        worker_pool(jobs=1, tasks=1) as pool,
    ):
        pool.submit(os._exit, 1).result()
