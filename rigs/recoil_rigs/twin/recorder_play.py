"""Plays one recorder: every packet at its time, with the faults that were declared, and the count of what happened."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from threading import Event

from recoil_rigs.twin.faults import Interval, PlayedRecorder, RecorderFaults, Ticks
from recoil_rigs.twin.opendaq_recorder import OpendaqRecorder
from recoil_rigs.twin.oxygen_recorder import Handling, OxygenRecorder
from recoil_rigs.twin.recorder_replay import SampleItem
from recoil_rigs.twin.source_play import SourcePlay

_MOST_CUTS = 4


class RecorderPlay(SourcePlay):
    """A recorder's part of a play; parameters as of `SourcePlay`."""

    def __init__(
        self,
        name: str,
        items: Iterator[SampleItem],
        transport: OxygenRecorder | OpendaqRecorder,
        faults: RecorderFaults,
        stop: Event,
        seed: Sequence[int],
    ) -> None:
        super().__init__(name, items, transport, faults, stop, seed)
        self._recorder, self._its_faults = transport, faults
        self._changes = sorted(faults.changes, key=lambda one: one.at_s)
        self._base = self._epoch = 0
        self._restarts = self._anew = False

    @staticmethod
    def _counts() -> PlayedRecorder:
        return PlayedRecorder()

    def begin(self, began_s: float, speed: float) -> None:
        """Go on from the recorder's rest, without a gap, and start the thread."""
        self._base = self.played.began_tick = self._recorder.begin_play(began_s)
        super().begin(began_s, speed)

    def _unplug_until(self, interval: Interval) -> None:
        super()._unplug_until(interval)
        self._restarts = interval in self._its_faults.restarts

    def _plug_again(self, at_s: float) -> None:
        if self._back_s is not None and at_s >= self._back_s and self._restarts:
            self._restarts = False
            if not self._wait(self._back_s):
                return
            self._recorder.restart()
            self._epoch += 1
            self._anew = True
        super()._plug_again(at_s)

    def _count_unplugged(self, item: SampleItem) -> None:  # type: ignore[override]
        self.played.frames += 1
        self.played.unplugged += 1
        self._note(self.played.unplugged_ticks, item)

    def _note(self, ticks: Ticks, item: SampleItem) -> None:
        ticks.add(self._epoch, self._base + item.first, item.raw.shape[1])

    def _send(self, item: SampleItem) -> None:  # type: ignore[override]
        played, faults, draw = self.played, self._its_faults, self._rng.random
        if self._anew:
            self._base, self._anew = -item.first, False
        first = self._base + item.first
        played.frames += 1
        played.shots += [(shot, self._epoch, self._base + tick) for shot, tick in item.begins]
        while self._changes and self._changes[0].at_s <= item.at_s:
            change = self._changes.pop(0).what
            self._recorder.change(change)
            played.changes.append((change, self._epoch, first))
        unlicensed = 0 < faults.licence_s <= item.at_s
        if unlicensed:
            self._recorder.end_licence()
        if unlicensed or any(one.holds(item.at_s) for one in faults.silences):
            played.silent += 1
            self._note(played.silent_ticks, item)
            return
        names = self._recorder.streamed
        lost, twice, lacks = (
            share > 0 and draw() < share for share in (faults.lost_frames, faults.doubled_frames, faults.lacking_frames)
        )
        without = int(self._rng.integers(len(names))) if lacks and names else None
        cuts = draw(self._rng.integers(1, _MOST_CUTS + 1)) if faults.cut_frames and draw() < faults.cut_frames else ()
        if not self._recorder.send(first, item.raw, Handling(lost, 1 + twice, without, tuple(cuts))):
            played.not_open += 1
            self._note(played.not_open_ticks, item)
        elif lost:
            played.lost += 1
            self._note(played.lost_ticks, item)
        else:
            played.sent += 1
            self._note(played.sent_ticks, item)
            if without is not None:
                played.lacking.append((names[without], self._epoch, first, item.raw.shape[1]))
            if twice:
                played.doubled += 1
                self._note(played.doubled_ticks, item)
