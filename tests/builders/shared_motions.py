"""What is made once in a test run for all of its processes: motions of the virtual rig, and what a test asks for.

Most of a simulated shot's time is the integration of its motion, and the shots of many tests differ in nothing but
their sensors. A motion is taken from another shot only if the mechanism, the shot and every setting that the
integration looked at are the same: none of them is listed here. It goes in steps of 40 us, those of the recorder of
most tests: what a step of 20 us gives differs by less than any sensor sees. Nothing outlives the run.
"""

from __future__ import annotations

import hashlib
import inspect
import io
import os
import pickle
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from functools import wraps
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar
from unittest.mock import patch

import numpy as np

from tests.builders.processor_time import apart

if TYPE_CHECKING:
    from recoil_rigs.mechanism.model import Mechanism
    from recoil_rigs.twin import TwinSettings
    from recoil_rigs.twin.motion import Motion

Made, Asked = TypeVar("Made"), ParamSpec("Asked")

FOLDER = "RECOIL_DAQ_MOTIONS_OF_THIS_RUN"
"""Environment variable: the folder that the processes of a run share."""
STEP_S = 40e-6
"""Of the integration, at most."""
LONGEST_S = 300.0
"""That a process may take to make what others wait for."""


@contextmanager
def folder_of_this_run() -> Iterator[None]:
    """Make the folder, or take that of the process that started this one; whoever made it removes it."""
    if FOLDER in os.environ:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="recoil-daq-motions-") as folder:
        os.environ[FOLDER] = folder
        try:
            yield
        finally:
            del os.environ[FOLDER]


def once_in_this_run(name: str, make: Callable[[Path], Made]) -> Made:
    """Return what the first process of the run that asks has made; nobody may change it.

    Parameters
    ----------
    make
        Given a new folder for files, returns what can be packed, see `Packer`.
    """
    with apart():
        return _once_in_this_run(name, make)


def _once_in_this_run(name: str, make: Callable[[Path], Made]) -> Made:
    folder = Path(os.environ[FOLDER]) / name
    made, deadline_s = folder.with_suffix(".made"), time.monotonic() + LONGEST_S
    while not made.exists():
        try:
            folder.mkdir()
        except FileExistsError:
            # another process is at it; where it failed, the folder is gone again
            assert time.monotonic() < deadline_s, f"nobody completes {folder}"
            time.sleep(0.05)
            continue
        try:
            _write(made, Packer.packed(make(folder)))
        except BaseException:
            shutil.rmtree(folder)
            raise
    return pickle.loads(made.read_bytes())  # noqa: S301 - of this run's own processes


def made_once(make: Callable[Asked, Made]) -> Callable[Asked, Made]:
    """Have a function called once in the run for the same arguments, however they are written.

    They are told apart by what `repr` says of them; what is returned is as of `once_in_this_run`.
    """
    signature, kept = inspect.signature(make), {}

    @wraps(make)
    def shared(*args: Asked.args, **more: Asked.kwargs) -> Made:
        asked = signature.bind(*args, **more)
        asked.apply_defaults()
        written = [sorted(one.items()) if isinstance(one, dict) else one for one in asked.arguments.values()]
        name = f"{make.__name__}-{_digest((make.__module__, written))}"
        if name not in kept:
            kept[name] = once_in_this_run(name, lambda _: make(*args, **more))
        return kept[name]

    return shared


class Packer(pickle.Pickler):
    """Packs mappings that nobody may change too, and arrays so that still nobody may."""

    @classmethod
    def packed(cls, made: object) -> bytes:
        """Return what `pickle.loads` makes the same of."""
        file = io.BytesIO()
        cls(file).dump(made)
        return file.getvalue()

    def reducer_override(self, thing: Any) -> Any:
        """Say how to make a thing anew where `pickle` does not know it."""
        if isinstance(thing, MappingProxyType):
            return _proxy, (dict(thing),)
        if type(thing) is np.ndarray and not thing.flags.writeable:
            return _kept_from_changes, (thing.copy(),)
        return NotImplemented


def _proxy(mapping: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(mapping)  # by its own name no module has the type


def _kept_from_changes(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def share_motions() -> None:
    """Have the virtual rig take its motions from the run's folder, where a test has imported it."""
    scene = sys.modules.get("recoil_rigs.twin.gun_scene")
    if scene is not None and FOLDER in os.environ:
        assert "simulate_motion" in vars(scene)
        vars(scene)["simulate_motion"] = SharedMotions(Path(os.environ[FOLDER]), in_long_steps)


def in_long_steps(mechanism: Mechanism, settings: TwinSettings, **shot: float) -> Motion:
    """Integrate as `recoil_rigs.twin.motion.simulate_motion` does, in steps of at most `STEP_S`."""
    from recoil_rigs.twin import motion

    with patch.object(motion, "_LARGEST_STEP_S", STEP_S):
        return motion.simulate_motion(mechanism, settings, **shot)


class SharedMotions:
    """`recoil_rigs.twin.motion.simulate_motion`, which integrates what no process of the run has integrated.

    Parameters
    ----------
    folder : Path
    integrate : callable
    """

    def __init__(self, folder: Path, integrate: Callable[..., Motion]) -> None:
        self._folder, self._integrate = folder, integrate

    def __call__(
        self, mechanism: Mechanism, settings: TwinSettings, *, peak_pressure_pa: float, friction_n: float
    ) -> Motion:
        shot = (mechanism, peak_pressure_pa, friction_n)
        for looked_at in self._folder.glob("*.names"):
            kept = self._kept(shot, settings, looked_at.read_text().splitlines())
            if kept.exists():
                return _read_only(pickle.loads(kept.read_bytes()))  # noqa: S301 - of this run's own processes
        seen = Seen(settings)
        with apart():
            motion = self._integrate(mechanism, seen, peak_pressure_pa=peak_pressure_pa, friction_n=friction_n)
        names = sorted(seen.names)
        _write(self._kept(shot, settings, names), pickle.dumps(motion))
        _write(self._folder / f"{_digest(names)}.names", "\n".join(names).encode())
        return _read_only(motion)

    def _kept(self, shot: object, settings: TwinSettings, looked_at: Sequence[str]) -> Path:
        return self._folder / f"{_digest([shot, *((name, getattr(settings, name)) for name in looked_at)])}.motion"


class Seen:
    """Settings that remember which of them were looked at."""

    def __init__(self, settings: TwinSettings) -> None:
        self._settings = settings
        self.names: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        # remembered, so that this is not asked again: the integration looks at some of them at every step
        value = self.__dict__[name] = getattr(self._settings, name)
        self.names.add(name)
        return value


def _write(path: Path, content: bytes) -> None:
    partial = path.with_suffix(f".{os.getpid()}")
    partial.write_bytes(content)
    partial.replace(path)


def _digest(things: object) -> str:
    return hashlib.sha256(repr(things).encode()).hexdigest()


def _read_only(motion: Motion) -> Motion:
    for field in fields(motion):
        value = getattr(motion, field.name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return motion
