"""The thread that reads one device and hands every block on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from recoil_acquisition.devices.device import (
    EVENT,
    IDLE,
    LARGEST_PIECE,
    LATE_S,
    Block,
    Device,
    event_block,
    event_of,
    pieces,
)
from recoil_acquisition.errors import DeviceError

READ_TIMEOUT_S = 0.1
"""Longest wait for a block: how soon the thread sees that it is to stop."""

IDLE_EVERY_NS = 1_000_000_000
"""Time between two records that a device is there and silent."""


class DeviceReader:
    """Reads an open device in a thread of its own until it is stopped.

    Besides the device's blocks it hands on that the device is silent, once a second, and an event ``stalled`` before a
    block that may have waited for longer than `LATE_S`. A block that is too large for a record of the log comes in
    pieces.

    The sink is called in that thread, with every block in order. If it raises, reading stops,
    because a block that nobody keeps is lost: the device is closed, and `error` says why.

    Parameters
    ----------
    device
        Device that is open. The reader closes it.
    sink
        Function that takes a block.
    """

    def __init__(self, device: Device, sink: Callable[[Block], None]) -> None:
        self.device = device
        self._sink = sink
        self._stopping = threading.Event()
        # A daemon, so that a program that dies elsewhere ends; `stop` is what ends it in order
        self._thread = threading.Thread(target=self._run, name=f"read {device.name}", daemon=True)
        self._error: BaseException | None = None
        self._last_data_ns = 0
        self._last_ns = time.monotonic_ns()
        self._lost = False

    @property
    def error(self) -> BaseException | None:
        """The error by which it stopped by itself; None if it did not."""
        return self._error

    @property
    def data_age_s(self) -> float | None:
        """Time since the last block of data was read; None if there was none."""
        last = self._last_data_ns
        return (time.monotonic_ns() - last) / 1e9 if last else None

    def start(self) -> None:
        """Begin to read; RuntimeError if it was started before."""
        self._thread.start()

    def stop(self, timeout_s: float = 10.0) -> None:
        """Read what still waits, hand it on, close the device and end the thread; further calls do nothing.

        Raises
        ------
        DeviceError
            If the thread does not end in time: the sink or the driver hangs.
        """
        self._stopping.set()
        if self._thread.ident is None:
            self._finish()
            return
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise DeviceError(
                f"source '{self.device.name}': its device hangs, and is not closed within {timeout_s:g} s",
                remedy="unplug it, and look at its driver",
            )

    def __enter__(self) -> DeviceReader:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                asked_ns = time.monotonic_ns()
                block = self.device.read(READ_TIMEOUT_S)
                if block is not None:
                    self._hand_on(block)
                elif asked_ns - self._last_ns >= IDLE_EVERY_NS and not self._lost:
                    self._hand_on(Block(self.device.name, time.monotonic_ns(), b"", IDLE, asked_ns))
        except BaseException as error:
            self._error = error
        finally:
            self._finish()

    def _finish(self) -> None:
        """Close the device and hand on what it still held."""
        try:
            rest = self.device.close()
        except Exception as error:
            self._error = self._error or error
            return
        for block in rest:
            if self._error is not None:
                return
            try:
                self._hand_on(block)
            except Exception as error:
                self._error = error

    def _hand_on(self, block: Block) -> None:
        if block.kind == EVENT:
            self._lost = self._lost_after(block)
        elif block.is_data:
            if (late_s := block.late_s(self._last_ns)) > LATE_S:
                detail = f"nothing was read for {late_s:.3f} s"
                self._sink(event_block(block.source, block.host_ns, "stalled", detail))
            self._last_data_ns = block.host_ns
        if block.kind != EVENT:
            self._last_ns = block.host_ns
        if len(block.payload) <= LARGEST_PIECE or not block.is_data:
            self._sink(block)
            return
        for piece in pieces(block):
            self._sink(piece)

    def _lost_after(self, event: Block) -> bool:
        return {"lost": True, "reopened": False}.get(event_of(event).name, self._lost)
