"""Armed acquisition at the range, with devices or with a virtual rig that plays itself."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.cut import acquisition_in
from recoil_acquisition.errors import ReadError, RecoilDaqError, quoted
from recoil_acquisition.log.folder import find_logs
from recoil_acquisition.log.segment import SUFFIX
from recoil_daq.live.display import Display
from recoil_daq.live.output_folder import OutputFolder
from recoil_daq.live.range import REST_S, LiveRange, trigger_of
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.recover import recover_journal
from recoil_daq.live.recovered import RecoveredShot
from recoil_daq.live.shot import LiveOptions, LiveOutcome, LiveShot, ShotState, free_number
from recoil_daq.live.shots.earlier_shots import EARLIER
from recoil_daq.live.wakefulness import kept_awake
from recoil_daq.warm_worker import WarmWork, WarmWorker
from recoil_rigs.rig import Rig
from recoil_rigs.shots.left_out import left_out
from recoil_rigs.shots.live_sources import live_sources
from recoil_rigs.twin.range_day import RangeDay, is_virtual_rig

_WARM = "recoil_daq.reports.shot_mass:warm"
_DAY = "recoil_daq.handover.day:day_page"
VIRTUAL_SHOTS = 3
"""Number of shots that a virtual rig fires where none is asked for."""

WARM_WITHIN_S = 60.0
"""Longest time for which the first virtual shot waits for the worker, s."""
_LOOK_S = 0.05


def run_live(
    rig: Rig,
    options: LiveOptions,
    display: Display,
    *,
    play: Mapping[str, Any] | None = None,
    watch_day: Callable[[RangeDay], None] = lambda _: None,
) -> LiveOutcome:
    """Arm the devices of a rig, and make a shot file of every shot.

    Parameters
    ----------
    rig
        Rig whose devices are read. Virtual devices are played here, and the files of its other sources are dropped into
        the watched folder, which is ``OUT/incoming`` unless it is given.
    play
        Keywords of `RangeDay` for a virtual rig.
    watch_day
        Function called with the virtual day once it is simulated.

    Raises
    ------
    RigError
        If the rig declares no trigger, or is at fault.
    DeviceError
        If a device cannot be opened, or no source has one.
    ReadError, StoreError
        If a folder cannot be used, another session has it, or the disk has not enough room.
    """
    trigger_of(rig)  # what is at fault is refused before anything is written
    live_sources(rig)
    left_out(rig, options.without, armed=True)
    if options.watch is not None:
        _refuse_own_folder(options.watch, options.out)
        if not is_virtual_rig(rig):
            _check_watched(options.watch)
    with OutputFolder(options.out) as folder:
        left, recovered = _recover(rig, options, display)
        first = options.first or free_number(options.out)
        with closing(WarmWorker()) as worker:
            there = [path for path in options.out.glob("*.h5") if path.is_file()]
            newest = max(there, key=lambda path: path.stat().st_mtime, default=None)
            earlier = worker.ask(EARLIER, options.out, again=None)
            # while the range is armed the worker does what the first shot would wait for
            warm = worker.ask(_WARM, (rig.path, newest, options.identify), again=None)
            if not is_virtual_rig(rig):
                chosen = replace(options, first=first)
                live = LiveRange(
                    rig,
                    chosen,
                    display,
                    folder,
                    rest_s=REST_S,
                    worker=worker,
                    left=left,
                    earlier=earlier,
                    recovered=recovered,
                )
                with kept_awake(display.notice):
                    outcome = live.run()
                _hand_over(worker, options, outcome, display, live.last)
                return outcome
            shots, watch = options.shots or VIRTUAL_SHOTS, options.watch or options.out / "incoming"
            chosen = replace(options, first=first, shots=shots, watch=watch)
            display.notice(f"virtual rig: simulating {shots} shots")
            with RangeDay(rig, shots, watch, first=first, **(play or {})) as day:
                watch_day(day)
                watch.mkdir(parents=True, exist_ok=True)
                _wait_for(worker, warm)
                live = LiveRange(
                    rig,
                    chosen,
                    display,
                    folder,
                    devices=day.devices,
                    over=lambda: day.over,
                    worker=worker,
                    earlier=earlier,
                    recovered=recovered,
                )
                outcome = live.run(day.start)
                if day.over:  # else it was interrupted, and its devices were closed under it
                    day.raise_failure()
            _hand_over(worker, options, outcome, display, live.last)
            return outcome


def _hand_over(
    worker: WarmWorker, options: LiveOptions, outcome: LiveOutcome, display: Display, last: RangeState | None
) -> None:
    """Write the page of the day, where shots are identified; what is wrong with it is said, and ends nothing."""
    if not options.identify or outcome.error is not None or not any(options.out.glob("*.h5")):
        return
    doing = "making the page of the day; Ctrl-C leaves that to `recoil-daq day`"
    display.notice(doing)
    made = worker.ask(_DAY, options.out)
    try:
        while not made.done:
            if last is not None:
                display.show(replace(last, asked=doing))
            time.sleep(_LOOK_S)
            worker.look()
        display.notice(f"the day, and what to copy of it: {made.result()}")
    except KeyboardInterrupt:
        display.notice(f"left out: `recoil-daq day {quoted(options.out)}` makes the page of the day")
    except Exception as error:  # whatever it is, the shots are in their files
        why = str(error) if isinstance(error, RecoilDaqError) else f"{type(error).__name__}: {error}"
        display.notice(f"no page of the day: {why}")


def _wait_for(worker: WarmWorker, warm: WarmWork) -> None:
    """Wait until the worker is warm, as it is at a range long before somebody fires; a virtual shot can wait."""
    ends_s = time.monotonic() + WARM_WITHIN_S
    while not warm.done and time.monotonic() < ends_s:
        time.sleep(_LOOK_S)
        worker.look()


def _refuse_own_folder(watched: Path, out: Path) -> None:
    """Refuse to watch the folder that is written to: what the session writes there would be taken for dropped files."""
    if watched.resolve() == out.resolve():
        raise ReadError(
            "is the folder of the shot files, and cannot be watched for those of other instruments",
            path=watched,
            remedy=f"give --watch a folder of its own, such as {out / 'incoming'}",
        )


def _check_watched(folder: Path) -> None:
    """Refuse a folder whose name is perhaps misspelt: nothing would ever come into it. Another is made when watched."""
    if folder.is_dir():
        return
    try:
        others = sorted(path.name for path in folder.parent.iterdir() if path.is_dir())
    except OSError:
        others = []
    near = get_close_matches(folder.name, others, 1)
    if folder.exists() or near or not folder.parent.is_dir():
        raise ReadError(
            "no such folder to watch" if not folder.exists() else "is no folder to watch",
            path=folder,
            found=str(folder.with_name(near[0])) if near else None,
            remedy="correct --watch, or make the folder first",
        )


def _recover(rig: Rig, options: LiveOptions, display: Display) -> tuple[list[LiveShot], list[str]]:
    """Recover what a crash left over before anything new is recorded; removing it is left to a person.

    Returns
    -------
    left : list of LiveShot
        Shots of the rig that wait for files of other instruments, which this session gives them.
    recovered : list of str
        Names of all shots that were recovered; of a journal without any, what that is worth.
    """
    left: list[LiveShot] = []
    recovered: list[str] = []
    journals = find_logs(options.out / "journal")
    done_before = [one for one in journals if (options.out / "recovered" / f"{one.name}{SUFFIX}").exists()]
    if done_before:
        several = len(done_before) > 1
        which = f"{len(done_before)} journals are" if several else "a journal is"
        where = options.out if several else done_before[0]
        in_it = "them" if several else "it"
        display.notice(f"{which} still there: `recoil-daq recover {quoted(where)}` says what is in {in_it}")
    for journal in journals:
        if journal in done_before:
            continue
        display.notice(f"a journal was left over: recovering {journal}")
        try:
            done = recover_journal(journal, options.out, keep=True)
        except RecoilDaqError as error:
            display.notice(f"it is left as it is: {error}")
            continue
        except Exception as error:  # whatever is in an old journal, it keeps no range from being armed
            display.notice(f"it is left as it is: {type(error).__name__}: {error}")
            continue
        new = [f"shot {shot.name}" for shot in done.shots if not shot.was_there]
        recovered += new or ["no shot that had no capture"]
        for shot in done.shots:
            capture = f"its capture is {shot.path}"
            what = capture if shot.shot_file is None else f"its shot file is {shot.shot_file}"
            why = f"; no shot file: {shot.problem}" if shot.problem else ""
            display.notice(f"shot {shot.name} recovered: {what}{why}")
        waiting = [one for shot in done.shots if (one := _waiting(shot)) is not None]
        if options.watch is not None and not is_virtual_rig(rig):
            if (done.rig.text, dict(done.rig.databases)) == (rig.text, dict(rig.databases)):
                left += waiting
            elif waiting:
                names = ", ".join(shot.name for shot in waiting)
                why = "this rig is not the one as which they were fired"
                display.notice(f"still waiting for files: {names}; {why}, so that they are finished by hand")
        if done.everything is not None:
            display.notice(f"everything that could be read of it is in {done.everything}")
        found = [f"{done.lost_records} records missing, {done.damaged_bytes} bytes damaged"] if done.damaged else []
        found += [f"{len(done.outside)} times something happened outside of every shot"] if done.outside else []
        display.notice("; ".join([*found, f"it is kept: `recoil-daq recover {quoted(journal)}` says more"]))
    return left, recovered


def _waiting(shot: RecoveredShot) -> LiveShot | None:
    """Return a shot of a session that crashed as one that waits for its files; None if it needs none, or is made."""
    acquisition = acquisition_in(shot.path)
    if shot.shot_file is not None or not shot.missing or acquisition is None:
        return None
    files = {source.name: shot.path for source in acquisition.sources if source.file}
    return LiveShot(
        shot.name, state=ShotState.WAITING, captured=shot.path, acquisition=acquisition, files=files,
        wanted=set(shot.missing),
    )  # fmt: skip
