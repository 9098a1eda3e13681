"""The verb ``console``: a study's pages, for the experimenter and for the participants."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import PathOrNone


def console(
    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY")],
    port: Annotated[int, tyro.conf.arg(help="Of the pages; 0 takes any free one.")] = 8765,
    host: Annotated[
        str, tyro.conf.arg(help="Address to serve; the default reaches this machine alone.")
    ] = "127.0.0.1",
    open: Annotated[
        bool, tyro.conf.arg(help="Open the page where the experimenter types the sign-in code.")
    ] = False,
    device: Annotated[
        str, tyro.conf.arg(help="At which participants sit: wheel, wheel:NAME, keyboard, ...")
    ] = "wheel",
    kiosk: Annotated[
        bool,
        tyro.conf.arg(help="Page and wheel are one computer: participants start their drives."),
    ] = False,
    allow_network: Annotated[
        bool, tyro.conf.arg(help="Serve an address that other machines can reach.")
    ] = False,
    password_file: Annotated[
        PathOrNone, tyro.conf.arg(help="Its first line signs the experimenter in.")
    ] = None,
    tls_cert: Annotated[PathOrNone, tyro.conf.arg(help="PEM certificate.")] = None,
    tls_key: Annotated[PathOrNone, tyro.conf.arg(help="PEM key of the certificate.")] = None,
) -> int:
    """The pages of a study: participants, progress, questionnaires; Ctrl+C ends them.

    Prints a link by which the experimenter signs in, once; its last part can be typed as well.
    For a tablet, serve a network address:
    --host 192.168.1.20 --allow-network --password-file FILE --tls-cert FILE --tls-key FILE.

    Example: steerlab console my-study --open
    """
    from steerlab.app.console.config import ConsoleConfig
    from steerlab.app.console.server import serve
    from steerlab.sim.files.folder_lock import CONSOLE_LOCK, locked
    from steerlab.sim.language import speak
    from steerlab.study.study import Study

    config = ConsoleConfig(
        host=host,
        port=port,
        allow_network=allow_network,
        password_file=password_file,
        tls_cert=tls_cert,
        tls_key=tls_key,
    )
    with Study.open(folder, read_only=True) as study:  # before a lock is left in what is no study
        speak(study.language)
    to_open = [True] if open else []

    def announce(address: str, code: str) -> None:
        print(f"Sign in (works once): {address}/enter/{code}", flush=True)
        if to_open:
            import webbrowser

            to_open.clear()
            webbrowser.open(address)  # without the code: other users see a command's arguments

    with locked(folder, CONSOLE_LOCK, "serves the pages of"):
        last = serve(
            folder,
            lambda: Study.open(folder),
            config,
            announce=announce,
            device=device,
            kiosk=kiosk,
        )
    print("The console has ended; every answer is kept.")
    if last is not None and last.goes_on:
        print(f"“{last.title}” of {last.participant} still runs, process {last.pid}.")
    return 0
