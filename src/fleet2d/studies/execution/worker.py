"""A worker process, which reads and writes messages on its standard streams.

It ends at once when the driver, which started it, has ended.
"""

import os
import queue
import sys
import threading
import traceback
from contextlib import suppress
from typing import IO, Any

from fleet2d.memory import rare_collections
from fleet2d.studies.execution.pipe import receive, send

READY, RESULT, BROKEN = "ready", "result", "broken"


def main() -> None:
    """Receive the job, then run tasks until there are no more."""
    # Output of users' components goes to standard error: standard output carries messages.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()
    stream = sys.stdin.buffer
    try:
        job = _receive_job(stream)
    except EOFError:  # the driver has ended
        return
    except BaseException:  # noqa: BLE001 - imports may raise anything
        with suppress(OSError):
            send(answers, (BROKEN, traceback.format_exc()))
        return
    threading.Thread(target=_listen, args=(stream, tasks), daemon=True).start()
    try:
        send(answers, (READY, None))
        _work(job, tasks, answers)
    except BrokenPipeError:
        os._exit(0)  # the driver has ended


def _receive_job(stream: IO[bytes]) -> Any:
    folder, sys.path[:] = receive(stream)
    os.chdir(folder)
    with rare_collections():  # of the modules that the job needs
        return receive(stream)


def _work(job: Any, tasks: "queue.SimpleQueue[Any]", answers: IO[bytes]) -> None:
    from fleet2d.studies.simulator import peak_rss_mb

    while (task := tasks.get()) is not None:
        send(answers, (RESULT, (task, job(task), peak_rss_mb())))
    os._exit(0)  # the listening thread blocks a normal exit


def _listen(stream: IO[bytes], tasks: "queue.SimpleQueue[Any]") -> None:
    """Queue the tasks that arrive; end the process when the driver has ended."""
    try:
        while True:
            tasks.put(receive(stream))
    except (EOFError, OSError):
        os._exit(0)


if __name__ == "__main__":
    main()
