"""The messages of a CAN database, and the frames of a log that carry them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import ReadError
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.packages.can_library import load_can_library
from recoil_acquisition.readers.can.decoding import SignalLayout, layouts_of, told_apart
from recoil_acquisition.readers.can.frames import EXTENDED, CanFrames, key_of
from recoil_acquisition.readers.can.multiplexing import MultiplexerRanges
from recoil_acquisition.readers.can.parameter_groups import Sender, group_of, is_j1939, name_in_group, split_identified
from recoil_acquisition.readers.time.increasing_stamps import increasing, single_ahead
from recoil_acquisition.remark import Note, NoteCode, Remark

XML_FORMATS = ("kcd", "arxml")

_ENTITIES = re.compile(r"<!\s*(?:DOCTYPE|ENTITY)", re.IGNORECASE)
_ROOT = re.compile(r"<(?:[A-Za-z_][\w.-]*:)?([A-Za-z_][\w.-]*)(?=[\s/>])")
_SYM = re.compile(r"\ufeff?\s*(?://[^\n]*\s*)*FormatVersion\s*=", re.IGNORECASE)
_QUOTED = re.compile(r'"[^"]*"')
_NUMBER = r"\s*\+?(\d[\d_]*)"
_BYTES = {
    "dbc": re.compile(rf":{_NUMBER}(?!\s*\|)"),
    "kcd": re.compile(rf"""\blength\s*=\s*["']{_NUMBER}"""),
    "sym": re.compile(rf"^\s*(?:Len|DLC)\s*={_NUMBER}", re.MULTILINE | re.IGNORECASE),
    "arxml": re.compile(rf"LENGTH>{_NUMBER}"),
}
"""Patterns of the places where a database may state the length of a message."""
_BITS = {
    "dbc": re.compile(rf":{_NUMBER}(?=\s*\|)|\|{_NUMBER}\s*@"),
    "kcd": re.compile(rf"""\boffset\s*=\s*["']{_NUMBER}"""),
    "sym": re.compile(r"[\s,](\d+)(?![\w.])"),
    "arxml": re.compile(rf"POSITION>{_NUMBER}"),
}
"""Patterns of the places where a database may state the place or length of a signal."""
MOST_SQUARED_BYTES = 3e8
"""Sum of the squares of all stated lengths, bytes: cantools takes time with them, whatever a length is, and 5 s for
this. 10,000 messages of 64 bytes have 4e7."""
MOST_TOKENS = 1_600_000
"""Names, numbers and signs of a database: cantools takes 3 to 10 s for a million. One of 4 MB with 64,000 signals has
1.5 million."""
_TOKEN = re.compile(r'"[^"]*"|\w+|[^\w\s]')
_DBC = re.compile(r"^\s*(?:VERSION\b|NS_\b|BS_\b|BU_\b|BO_\b)", re.MULTILINE)


@dataclass(frozen=True, eq=False)
class Messages(ReadOnlyArrays):
    """One message's frames in a log.

    Attributes
    ----------
    time_s : ndarray of float64, shape (n_frames,)
        Stamps, increasing, s; of frames that were stamped at one instant all may be there, see `each_later`.
    length : ndarray of int64, shape (n_frames,)
    data : ndarray of uint8, shape (n_frames, width)
    backward
        Number of frames that were left out because their stamp goes back.
    """

    name: str
    layouts: dict[str, SignalLayout]
    time_s: NDArray[np.float64]
    length: NDArray[np.int64]
    data: NDArray[np.uint8]
    backward: int = 0

    def each_later(self) -> Messages:
        """Return the frames whose stamp is later than all before it."""
        if (np.diff(self.time_s) > 0).all():
            return self
        later = increasing(self.time_s)
        return replace(self, time_s=self.time_s[later], length=self.length[later], data=self.data[later])


@dataclass(frozen=True)
class FaultyMessage:
    """A message of a database whose signals overlap, or do not fit into it.

    Attributes
    ----------
    key
        Identifier, with bit 31 for 29 bits.
    fault
        Fault as cantools words it.
    """

    name: str
    key: int
    fault: str


@dataclass(frozen=True, eq=False)
class DatabaseSignal:
    """One signal of one message of a database.

    Attributes
    ----------
    name
        Name of its own, ``Message.Signal``: no other signal of the database has it.
    key
        Identifier of the message, with bit 31 for 29 bits.
    layout
        Layout of the signal; None if it is not decoded.
    layouts
        Layouts of all signals of the message.
    is_j1939
        Whether the message is known by its parameter group: any address may send it.
    """

    name: str
    key: int
    unit: str
    layout: SignalLayout | None
    layouts: dict[str, SignalLayout]
    is_j1939: bool = False


@dataclass(frozen=True, eq=False)
class CanDatabase:
    """A parsed CAN database.

    Attributes
    ----------
    messages
        Messages that are sound.
    faulty
        Messages of which no signal is read.
    numbered
        Signals whose name here has a number, since another one of their message has that name.
    """

    messages: tuple[Any, ...]
    faulty: tuple[FaultyMessage, ...] = ()
    numbered: tuple[str, ...] = ()

    @cached_property
    def own_names(self) -> tuple[str, ...]:
        """Names of the messages, told apart: one that is not the only one of its name has its identifier behind it."""
        counts = Counter([message.name for message in self.messages] + [one.name for one in self.faulty])
        return tuple(
            told_apart(
                [
                    f"{message.name}#{identifier_text(key_of(message))}" if counts[message.name] > 1 else message.name
                    for message in self.messages
                ]
            )
        )

    @cached_property
    def signals(self) -> Mapping[str, tuple[DatabaseSignal, ...]]:
        """All signals by their names, ``Message.Signal``.

        Of messages of one name each signal has two: that of its own, and that which it shares, under which it stands
        beside the others.
        """
        found: dict[str, tuple[DatabaseSignal, ...]] = {}
        for message, own_name in zip(self.messages, self.own_names, strict=True):
            layouts = layouts_of(message)
            for signal in message.signals:
                layout = layouts.get(signal.name)
                one = DatabaseSignal(
                    f"{own_name}.{signal.name}", key_of(message), signal.unit or "", layout, layouts, is_j1939(message)
                )
                names = (own_name, message.name, name_in_group(message))
                for known in dict.fromkeys(f"{name}.{signal.name}" for name in names):
                    found[known] = (*found.get(known, ()), one)
        return MappingProxyType(found)

    def named(self, name: str) -> tuple[DatabaseSignal, ...]:
        """Return the signals of a name, which may state an identifier of the message's parameter group."""
        identified = split_identified(name)
        if name in self.signals or identified is None:
            return self.signals.get(name, ())
        signal, identifier = identified
        return tuple(
            replace(one, name=name, key=identifier | EXTENDED)
            for one in self.signals.get(signal, ())
            if one.is_j1939 and group_of(one.key) == group_of(identifier)
        )

    def sender_of(self, signal: DatabaseSignal) -> Sender:
        """Return who sends a signal's message: any address, unless its name states one or others have the group."""
        groups = [group_of(one.frame_id) for one in self.messages if is_j1939(one)] if signal.is_j1939 else []
        is_any = groups.count(group_of(signal.key)) == 1 and signal.name in self.signals
        return Sender(signal.key, of_group=signal.is_j1939, is_any=is_any)

    def refuse_faulty(self, signal: str, path: Path) -> None:
        """Raise `ReadError` if a signal, such as ``Message.Signal``, is of a faulty message."""
        for one in self.faulty:
            if signal.partition(".")[0] == one.name:
                raise ReadError(
                    f"the message {one.name!r} of the CAN database is faulty, and {signal!r} is used",
                    path=path,
                    found=one.fault,
                    remedy="correct the message in the database that the rig file names",
                )

    def notes(self) -> list[Remark]:
        """Say which messages are faulty, and which names are those of several messages or signals."""
        shared = [own for message, own in zip(self.messages, self.own_names, strict=True) if own != message.name]
        notes: list[Remark] = []
        if shared:
            text = f"messages of one name in the database, told apart by their identifiers: {_first(shared)}"
            notes.append(Note(NoteCode.NAMES, None, text))
        if self.numbered:
            text = f"signals of one name in one message, told apart by numbers: {_first(self.numbered)}"
            notes.append(Note(NoteCode.NAMES, None, text))
        if not self.faulty:
            return notes
        shown = "; ".join(f"{one.name} ({one.fault.rstrip('.')})" for one in self.faulty[:8])
        more = " ..." if len(self.faulty) > 8 else ""
        text = f"faulty messages of the database, {len(self.faulty)}, were left out: {shown}{more}"
        return [*notes, Note(NoteCode.LEFT_OUT, None, text)]


def _first(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (" ..." if len(names) > 8 else "")


def identifier_text(key: int) -> str:
    """Spell an identifier as candump does: three digits of 11 bits, eight of 29."""
    return f"0x{key & ~EXTENDED:08X}" if key & EXTENDED else f"0x{key:03X}"


def load_database(text: str, path: Path) -> CanDatabase:
    """Parse the text of a CAN database; its format is found from its content.

    Faulty messages among sound ones are named in what is returned, and left to be refused where they are used.

    Parameters
    ----------
    text
        Text of a DBC, KCD, SYM or ARXML file.
    path
        Log that needs it, for messages.

    Raises
    ------
    ReadError
        If it is none of these formats, defines entities, or with what cantools found wrong.
    """
    kind = database_format(text)
    if not kind or (kind in XML_FORMATS and _ENTITIES.search(text)):
        raise ReadError(
            "the CAN database defines entities, which no database needs" if kind else "this is no CAN database",
            path=path,
            expected="the text of a DBC, KCD, SYM or ARXML file",
            remedy="correct the database that the rig file names",
        )
    try:
        _check_sizes(text, kind)
        return _parse_database(text, kind)
    except Exception as error:
        cause: BaseException = getattr(error, f"e_{kind}", None) or error
        first = str(cause).strip().splitlines()
        raise ReadError(
            f"the CAN database cannot be read: {first[0][:200] if first else type(cause).__name__}",
            path=path,
            expected=f"the text of a {kind.upper()} file",
            remedy="correct the database that the rig file names",
        ) from error


def database_format(text: str) -> str:
    """Return a database's format by its content: ``kcd``, ``arxml``, ``sym``, ``dbc``, or empty for none of them."""
    if text.lstrip("\ufeff \t\r\n").startswith("<"):
        root = _ROOT.search(text)
        return {"NetworkDefinition": "kcd", "AUTOSAR": "arxml"}.get(root[1] if root else "", "")
    if _SYM.match(text):
        return "sym"
    return "dbc" if _DBC.search(text) else ""


def _check_sizes(text: str, kind: str) -> None:
    """Refuse what cantools would be busy with for minutes: more text than a bus needs, and lengths that none has."""
    if (tokens := sum(1 for _ in _TOKEN.finditer(text))) > MOST_TOKENS:
        raise ValueError(f"{tokens} names, numbers and signs, where {MOST_TOKENS} are the most that is read")
    plain = text if kind in XML_FORMATS else _QUOTED.sub("", text)
    total = 0.0
    for places, bits in ((_BYTES[kind], 1), (_BITS[kind], 8)):
        for found in places.finditer(plain):
            digits = (next(filter(None, found.groups()))).replace("_", "")
            size = float(digits) / bits
            total += size * size
            if total > MOST_SQUARED_BYTES:
                raise ValueError(f"messages and signals as long as {digits[:20]} {'bits' if bits > 1 else 'bytes'}")


@lru_cache(maxsize=4)
def _parse_database(text: str, kind: str) -> CanDatabase:
    """Parse once per text: a campaign reads hundreds of logs with one database."""
    load_can_library()
    import cantools
    from cantools.database.errors import Error

    ranges = MultiplexerRanges(text) if kind == "dbc" else None
    loose: Any = cantools.database.load_string(ranges.short_text if ranges else text, kind, strict=False)
    sound, faulty, numbered = [], [], []
    for message in loose.messages:
        # cantools takes signals of one name for one that overlaps itself
        for signal, name in zip(message.signals, told_apart([one.name for one in message.signals]), strict=True):
            if signal.name != name:
                signal.name = name
                numbered.append(f"{message.name}.{name}")
        try:
            message.refresh(strict=True)
        except Error as fault:
            faulty.append(FaultyMessage(message.name, key_of(message), str(fault)))
        else:
            sound.append(message)
            for signal in message.signals:
                if ranges is not None and signal.multiplexer_ids:
                    signal.multiplexer_ids = ranges.in_full(key_of(message), signal.multiplexer_ids)
    if faulty and not sound:
        raise ValueError(faulty[0].fault)
    return CanDatabase(tuple(sound), tuple(faulty), tuple(numbered))


def messages_of(
    message: Any, frames: CanFrames, chosen: NDArray[np.intp], notes: list[Remark], name: str = ""
) -> Messages:
    """Take one message's frames; those whose stamp goes back are left out.

    Parameters
    ----------
    chosen : ndarray of int, shape (n_frames,)
        Places of the frames of that message, all of one bus.
    name
        Name that the message has here, if not that of the database.
    notes
        List that notes on the signals are added to.
    """
    name = name or message.name
    time_s = np.take(frames.time_s, chosen)
    kept = chosen
    if not (np.diff(time_s) >= 0).all():
        single = single_ahead(time_s)
        forward = ~single & (time_s >= np.maximum.accumulate(np.where(single, -np.inf, time_s)))
        kept, time_s = chosen[forward], time_s[forward]
    layouts = layouts_of(message)
    for signal in message.signals:
        if signal.name not in layouts:
            own = f"{name}.{signal.name}"
            notes.append(Note(NoteCode.LEFT_OUT, own, f"{own}: {signal.length} bits are not decoded"))
    width = max([layout.bytes_needed for layout in layouts.values()], default=8)
    data = np.take(frames.data, kept, axis=0)
    if data.shape[1] < width:
        data = np.pad(data, ((0, 0), (0, width - data.shape[1])))
    return Messages(name, layouts, time_s, np.take(frames.length, kept), data, int(chosen.size - kept.size))


def count_identifiers(keys: NDArray[np.uint32]) -> dict[str, int]:
    """Count the frames per identifier."""
    found, counts = np.unique(keys, return_counts=True)
    return {
        f"{int(k) & ~EXTENDED:#x}{' (29 bit)' if int(k) & EXTENDED else ''}": int(n)
        for k, n in zip(found, counts, strict=True)
    }
