"""The files of pages: the page itself, and one script for all that stand in a folder."""

from __future__ import annotations

import contextlib
import filecmp
import hashlib
import shutil
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from recoil_acquisition.errors import StoreError
from recoil_acquisition.files.new_file import give_name, partial_path, remove_partials

SCRIPT_NAME = "plotly.min.js"
LEFT_OVER_S = 3600.0
"""Age from which on a part of a script is taken for one whose writer was ended: a copy takes a second."""


def write_page(folder: Path, page: str, name: str) -> Path:
    """Write a page; what it refers to is written by `write_script`.

    Parameters
    ----------
    folder
        Created where it is missing. An older page in it is replaced.
    page
        Page of `recoil_identification.report.page.html`.
    name
        Name of the file.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    StoreError
        The folder cannot be written.
    """
    path = folder / name
    with _written(folder):
        path.write_text(page, encoding="utf-8", newline="\n")
    return path


def write_script(folder: Path) -> Path:
    """Write the script that draws figures, unless it is there: one for all pages that refer to it.

    Parameters
    ----------
    folder
        Folder: for a shot's pages the one that holds the shot's folder, for a campaign's page its own.

    Raises
    ------
    StoreError
        The folder cannot be written, or plotly's script is not installed.
    """
    script, path = plotly_script(), folder / SCRIPT_NAME
    with _written(folder):
        with contextlib.suppress(OSError):  # another process removed it, or has it open
            remove_partials(path, idle_s=LEFT_OVER_S)
        if not _same(script, path):
            # several processes may write their reports beside one another
            partial = partial_path(path)
            try:
                shutil.copyfile(script, partial)
                give_name(partial, path, overwrite=True)
            except PermissionError:
                # another process reads the one that it has just written, which Windows does not replace then
                if not _same(script, path):
                    raise
            finally:
                partial.unlink(missing_ok=True)
    return path


def _same(one: Path, other: Path) -> bool:
    return other.is_file() and filecmp.cmp(one, other, shallow=False)


@contextlib.contextmanager
def _written(folder: Path) -> Iterator[None]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise StoreError(
            "the report page cannot be written",
            path=folder,
            found=error.strerror or str(error),
            remedy="free some space, or choose a folder you may write to with --out",
        ) from error


@cache
def script_sha256() -> str:
    """Return the SHA-256 of the script that `write_script` writes; StoreError as of `plotly_script`."""
    return hashlib.sha256(plotly_script().read_bytes()).hexdigest()


def plotly_script() -> Path:
    """Find plotly's browser script in the installed package, without importing that package.

    Raises
    ------
    StoreError
        It is not there.
    """
    spec = find_spec("plotly")
    for root in (spec.submodule_search_locations if spec is not None else None) or ():
        script = Path(root) / "package_data" / SCRIPT_NAME
        if script.is_file():
            return script
    raise StoreError(
        "the script that draws the report's figures is not installed",
        expected=f"package_data/{SCRIPT_NAME} in the package plotly",
        found="no package plotly" if spec is None else f"plotly without it in {spec.origin}",
        remedy="install it again: pip install --force-reinstall plotly",
    )
