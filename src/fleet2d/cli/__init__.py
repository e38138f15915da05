"""The command line: `fleet2d run`, `validate`, `show` and the rest; see `fleet2d --help`."""

import gc
import os
import sys
from typing import NoReturn

from fleet2d.cli.streams import open_streams, output_problem
from fleet2d.errors import Fleet2DError, InputError, ctrl_c_watch, exit_guard
from fleet2d.memory import keep_free_memory, rare_collections


def main() -> NoReturn:
    """Run the command line; exit codes: 0 success, 1 failure, 2 wrong input, 130 interrupted."""
    # NumPy starts a thread for each core when it is imported; nothing here multiplies matrices.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # To look for pydantic's plugins takes as long as to import it.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    keep_free_memory()
    open_streams()
    code: str | int | None = 0
    try:
        with ctrl_c_watch(), exit_guard(), rare_collections():
            from fleet2d.cli.app import app

            gc.freeze()  # modules live to the end: the collector needn't scan them
            app(standalone_mode=True)
    except SystemExit as end:
        code = end.code
    except Fleet2DError as error:
        for line in (f"error: {error}", *getattr(error, "__notes__", ())):
            sys.stderr.write(f"{line}\n")
        code = 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt:
        code = 130
    except OSError:
        if not output_problem():
            raise
    if problem := output_problem():
        if not code:
            sys.stderr.write(f"error: the output can't be written ({problem})\n")
        code = code or 1
    sys.exit(code)
