"""`ds47 demo`: the tour capture, its report as text and as a page in the browser, and what to type next.

Here: where the capture comes from and where the files go. The reports are those of `ds47 report`.
"""

from __future__ import annotations

import sys
import tempfile
import webbrowser
from importlib.resources import files
from pathlib import Path

import click

from ds47.cli.common import cannot_write, lang_option, stdout
from ds47.report.bilingual import say

NAME = "tour-machine.pcapng"
_PACKED, _CHECKOUT = files("ds47") / NAME, Path(__file__).resolve().parents[3] / "captures" / NAME


@click.command("demo")
@click.option(
    "-o", "--output", "folder", metavar="FOLDER", type=click.Path(file_okay=False, path_type=Path),
    help="Folder for capture and page.  [default: a temporary one]",
)  # fmt: skip
@click.option("--no-browser", is_flag=True, help="Do not open the page.")
@lang_option
def command(folder: Path | None, no_browser: bool, lang: str) -> int:
    """Show a small capture with many faults: its report here, and as a page in the browser.

    It installs nothing and uses no network.
    """
    from ds47.cli import main

    folder = folder or Path(tempfile.mkdtemp(prefix="ds47-demo-"))
    capture, page = folder / NAME, folder / "report.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        capture.write_bytes((_PACKED if _PACKED.is_file() else _CHECKOUT).read_bytes())
    except OSError as problem:
        raise cannot_write(str(capture), problem) from problem
    sys.stdout.flush()
    status = main(["report", "--lang", lang, str(capture)])
    status = status or main(["report", "-f", "html", "--lang", lang, "-o", str(page), str(capture)])
    if status:
        return status
    shown = not no_browser and webbrowser.open(page.as_uri())
    stdout().write(
        "\n" + say("demo_page" if shown else "demo_page_closed", path=page).text(lang) + "\n"
    )
    stdout().write(say("demo_next", path=capture).text(lang) + "\n")
    return 0
