"""A day at a virtual range: the rig's buses and ports play in real time, its recorder and camera drop their files."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import DeviceError, Fault, FaultCode, RigError
from recoil_acquisition.files.temporary_folder import temporary_folder
from recoil_rigs.rig import Rig
from recoil_rigs.twin import TwinShot, simulate_shot
from recoil_rigs.twin.player import TwinPlayer, is_virtual, playable_sources

FILES_AFTER_S = 0.5
"""Time after the end of a shot's record at which recorder and camera begin to write their files."""

LATE_LOOK_S = 0.05
"""Time between two looks whether a shot was played, s."""
PIECES = 4
PIECE_EVERY_S = 0.15
"""Time between the pieces in which a file is written, as by a camera's download: whoever picks it up too early has half
of it."""


def is_virtual_rig(rig: Rig) -> bool:
    """Return whether the devices of a rig are played.

    Raises
    ------
    RigError
        If some are and others are not.
    """
    live = [source for source in rig.sources if source.device is not None]
    virtual = [source.name for source in live if is_virtual(source)]
    if virtual and len(virtual) < len(live):
        problem = f"{', '.join(virtual)} virtual, others not: a rig is played whole or not at all"
        raise RigError(rig.path, [Fault(("source",), problem, FaultCode.CONTRADICTION)])
    return bool(virtual)


class RangeDay:
    """Some shots of a virtual rig, from switching on to the last dropped file.

    Parameters
    ----------
    drop_into
        Folder that gets the files of the sources that are not played; None if nobody watches.
    first
        Number of the first shot.
    seed
        Seed of the first shot; the next has the next. All share their sensors, as shots of a day do.
    silence_before_s, silence_after_s
        Silence before and after each shot.
    **play
        Further arguments of `TwinPlayer`: transports, faults.

    Raises
    ------
    ValueError
        If there is nothing to play.
    """

    def __init__(
        self,
        rig: Rig,
        shots: int,
        drop_into: Path | None,
        *,
        first: int = 1,
        seed: int = 1,
        silence_before_s: float = 2.0,
        silence_after_s: float = 1.5,
        **play: Any,
    ) -> None:
        self._folder = temporary_folder("range")
        self._drop_into = drop_into
        try:
            self.shots: tuple[TwinShot, ...] = tuple(
                simulate_shot(
                    rig, Path(self._folder.name) / f"{first + k:04d}", seed=seed + k, shot=f"{first + k:04d}",
                    campaign_seed=seed,
                )
                for k in range(shots)
            )  # fmt: skip
            self.player = TwinPlayer(
                rig, self.shots, silence_before_s=silence_before_s, silence_after_s=silence_after_s, seed=seed, **play
            )
        except BaseException:
            self._folder.cleanup()
            raise
        # a recorder writes its file beside what it streams
        played = {source.name for source in playable_sources(rig) if source.kind != "dewetron"}
        names = {s.name for s in rig.sources if s.name not in played}
        self._dropped = [
            [f for f in shot.files if any(s.name in names for s in rig.matching(f.name))] for shot in self.shots
        ]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._drop, name="drop files", daemon=True)
        self._failure: BaseException | None = None

    @property
    def devices(self) -> Mapping[str, Mapping[str, Any]]:
        """The ``device`` table of each source."""
        return self.player.devices

    def start(self) -> None:
        """Begin to play; the devices must be open."""
        self.player.start()
        self._thread.start()

    @property
    def over(self) -> bool:
        """Whether everything was played and dropped."""
        return not self._thread.is_alive() and not self.player.playing

    def raise_failure(self) -> None:
        """Raise what ended the play or the files of a day before their time, if anything did.

        Raises
        ------
        DeviceError
            With what it was.
        """
        for name, failure in (*self.player.failures.items(), ("files", self._failure)):
            if failure is not None:
                text = " ".join(str(failure).split()) or type(failure).__name__
                raise DeviceError(f"the virtual rig's {name} ended early: {text}") from failure

    def __enter__(self) -> RangeDay:
        self.player.plug()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop, and remove what was simulated; further calls do nothing."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()
        self.player.close()
        self._folder.cleanup()

    def _drop(self) -> None:
        began_s = self.player.fired_ns[0] / 1e9 - self.player.timeline.starts_s[0] - self.shots[0].truth["t_fire"]
        for start_s, files in zip(self.player.timeline.starts_s, self._dropped, strict=True):
            due_s = began_s + start_s + self.player.timeline.record_s + FILES_AFTER_S
            if self._stop.wait(max(due_s - time.monotonic(), 0.0)):
                return
            # on a busy host the play is late: a file must not be there before its shot
            while self.player.played_s < start_s + self.player.timeline.record_s:
                if self._stop.wait(LATE_LOOK_S):
                    return
            try:
                for file in files:
                    self._write(file)
            except OSError as error:
                self._failure = error
                return

    def _write(self, file: Path) -> None:
        if self._drop_into is None:
            return
        target = self._drop_into / file.name
        content = file.read_bytes()
        size = -(-len(content) // PIECES)
        with target.open("xb", buffering=0) as stream:
            for at in range(0, len(content), size):
                stream.write(content[at : at + size])
                if self._stop.wait(PIECE_EVERY_S):
                    return
