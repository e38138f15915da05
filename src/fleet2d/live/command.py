"""The commands `fleet2d live` and `fleet2d mcp`."""

import json
import os
import re
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.errors import InputError
from fleet2d.options import resume_hint, split


def live(
    arguments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENARIO.yaml|KEY.PATH=VALUE", help="A scenario and changes to it."
        ),
    ] = None,
    peers: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="URL",
            help="Another program: ws://HOST:PORT and udp://HOST:PORT listen there,"
            " rosbridge://HOST:PORT and mqtt://HOST:PORT/PREFIX connect, ros2:// joins ROS 2."
            " Several are possible.",
        ),
    ] = None,
    speed: Annotated[float, typer.Option(min=0.0, help="Times real time; 0: unpaced.")] = 1.0,
    silence: Annotated[
        float,
        typer.Option(min=0.1, help="A body stops if nothing has arrived for it for so long [s]."),
    ] = 5.0,
    keep_goals: Annotated[
        bool, typer.Option("--keep-goals", help="Keep the goals of a client that is gone.")
    ] = False,
    seed: Annotated[int | None, typer.Option(help="Seed of all random draws.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory to store the run in.")] = None,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of messages, and end.")
    ] = False,
) -> None:
    """Run in real time among other programs.

    They may move its people and robots.

    Examples:
      fleet2d live home.yaml --with ws://127.0.0.1:8765
      fleet2d live --with mqtt://localhost:1883/fleet2d --speed 10
    """
    if schema:
        from fleet2d.live.messages import message_schema

        typer.echo(json.dumps(message_schema(), indent=2))
        return
    from fleet2d.engine.simulation import Simulation
    from fleet2d.live.bridge import Bridge
    from fleet2d.live.library_errors import libraries_told
    from fleet2d.live.peers import open_peers
    from fleet2d.scenario.load import load_scenario

    scenario, overrides = split(arguments)
    changes = overrides if seed is None else [*overrides, f"simulation.seed={seed}"]
    with libraries_told(id):  # before and after the run, errors of libraries are dropped
        checked = load_scenario(scenario, *changes)
        opened = open_peers(checked, *peers or ())
        if not opened:
            raise InputError(
                "name at least one other program by --with, like --with ws://127.0.0.1:8765, or as"
                " the source of something live"
            )
        simulation = Simulation(checked, out=out)
        tell = partial(typer.echo, err=True)
        for address, peer in opened.items():
            port = getattr(peer, "port", None)
            shown = re.sub(r"//.*@", "//", address)  # without a password
            tell(f"{shown}: {'opened' if port is None else f'listens at {port}'}")
        bridge = Bridge(
            simulation, opened, speed, silence_s=silence, keeps_goals=keep_goals, tell=tell
        )
        run = bridge.run()
        for note in bridge.notes():
            tell(note)
        place = f", stored in {out}" if out else ""
        typer.echo(f"{run.status}, digest {(run.digest or '')[:8]}{place}")
    if run.status != "complete":
        if out is not None:
            tell(resume_hint(simulation.time, out))
        raise typer.Exit(130)


def mcp(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="The only folder that is read and written.")
    ],
) -> None:
    """Serve AI assistants within one folder.

    They speak the Model Context Protocol on stdin and stdout.

    Examples:
      fleet2d mcp experiments
    """
    from fleet2d.live.mcp_server import server

    app = server(folder)
    os.chdir(folder)  # where relative paths in overrides and interventions start
    app.run("stdio")
