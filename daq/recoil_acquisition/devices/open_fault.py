"""Reason why a device cannot be opened, in one line, with what to do about it."""

from __future__ import annotations

import errno
import re
from collections.abc import Sequence

from recoil_acquisition.errors import DeviceError, ErrorCode, nearest_first

_REMEDIES = {
    errno.ENOENT: ("there is no such port", "plug it in, or correct `device` in the rig file"),
    errno.ENODEV: ("there is no such device", "plug it in, or correct `device` in the rig file"),
    errno.ENXIO: ("the port has no hardware behind it", "plug it in, or correct `device` in the rig file"),
    errno.EACCES: (
        "the permission is missing",
        "add your user to the group that owns the port (`dialout` or `uucp`), and log in again",
    ),
    errno.EPERM: ("the permission is missing", "run it as a user who may use the device"),
    errno.EBUSY: ("another program uses it", "close that program"),
    errno.EAGAIN: ("another program uses it", "close that program"),
    errno.EADDRINUSE: ("another program uses the network port", "close that program, or choose another `port`"),
    errno.ENETDOWN: ("the interface is down", "bring it up, such as `ip link set can0 up type can bitrate 1000000`"),
    errno.ENETUNREACH: ("no network reaches this group", "bring a network up, or use another interface"),
    errno.EAFNOSUPPORT: (
        "this system has no such kind of socket",
        "load the kernel's CAN modules, or use an interface with a driver of its own",
    ),
    errno.EIO: ("the device does not answer", "unplug it and plug it in again"),
    errno.ENOTTY: ("this is no serial port", "correct `device` in the rig file"),
}
_MODULE = re.compile(r"(\w+) not installed")
_IN_TEXT = re.compile(r"\[Errno (\d+)\]")
_WINDOWS = (("FileNotFoundError", errno.ENOENT), ("PermissionError", errno.EBUSY))


def open_fault(source: str, what: str, error: BaseException, *, available: Sequence[str] = ()) -> DeviceError:
    """Map what a driver raised while it opened a device.

    Parameters
    ----------
    source
        Name of the source.
    what
        The device, as the rig declares it.
    available
        Devices that are there.

    Returns
    -------
    DeviceError
        Error to raise ``from`` the given one.
    """
    said = " ".join(str(error).split())[:200] or type(error).__name__
    if isinstance(error, ImportError | NotImplementedError):
        # python-can's error of an interface whose driver or library it does not find is a NotImplementedError
        lacking = _MODULE.fullmatch(said)
        manual = "install the library or the maker's driver that python-can's manual names for this interface"
        remedy = f"pip install {lacking[1]}" if lacking else manual
        problem = f"source '{source}': {what} needs a driver or a library that is not here: {said}"
        return DeviceError(problem, code=ErrorCode.NOT_INSTALLED, remedy=remedy)
    number = error_number(error)
    problem, remedy = _REMEDIES.get(number or 0, (f"the driver says: {said}", "correct `device` in the rig file"))
    found = None
    if number in (errno.ENOENT, errno.ENODEV):
        found = ", ".join(nearest_first(what, list(available))[:6]) or "no device at all"
    return DeviceError(f"source '{source}': {what} cannot be opened: {problem}", found=found, remedy=remedy)


def error_number(error: BaseException) -> int | None:
    """Find the system's number of an error, its causes' and its text's included; None if there is none.

    Drivers wrap the system's error in their own, most of them with the original as the cause, some
    with nothing but its text.
    """
    seen: BaseException | None = error
    while seen is not None:
        for number in (getattr(seen, "errno", None), getattr(seen, "error_code", None)):
            if isinstance(number, int):
                return number
        seen = seen.__cause__ or seen.__context__
    text = str(error)
    if match := _IN_TEXT.search(text):
        return int(match.group(1))
    # pyserial names the Windows error inside its own message, where PermissionError stands for a port in use
    return next((number for name, number in _WINDOWS if name in text), None)
