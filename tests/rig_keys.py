"""Every key of a rig file in one page, from the models: ``python -m tests.rig_keys`` writes docs/rig-keys.md.

A key without a meaning is a fault of the model: its field needs a description, or a docstring below it.
"""

from __future__ import annotations

import ast
import dataclasses
import datetime as dt
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from recoil_acquisition.frames import framing_tables as framing
from recoil_acquisition.frames.declaration import _KEYS as KEYS_OF_FRAMINGS
from recoil_acquisition.frames.ready_made import READY_MADE
from recoil_acquisition.quantities.quantity import SI_UNITS, UNITS
from recoil_acquisition.readers.text.layout import TextLayout
from recoil_acquisition.readers.tracks.layout import DeclaredFeature, TrackLayout
from recoil_acquisition.trigger import table as trigger
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.mechanism_parameters import MEANINGS, MechanismModel
from recoil_rigs.mechanism.mechanism_table import MODEL
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig_file import HEAD, SCHEMA
from recoil_rigs.tables import issue, knowledge
from recoil_rigs.tables import rig_tables as rig
from recoil_rigs.tables.channel_table import ChannelSpec, GaugeAhead, Sensor
from recoil_rigs.twin.line_settings import LineSettings
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.recorder_settings import RecorderSettings
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.unread_forces import UnreadForces

PAGE = Path(__file__).resolve().parents[1] / "docs" / "rig-keys.md"
INTRODUCTION = """\
# Every key of a rig file

Written by `python -m tests.rig_keys` from the models that validate a rig file. [The rig file](rig-file.md) has them
by example. A key without anything under "if left out" must be there. Numbers are SI, angles in rad, where nothing
else is said.
"""

DEVICE_OF_BUS = {
    "interface": ("text", "", "interface of python-can, such as `socketcan`, `pcan`, `kvaser`, `vector`, `slcan`"),
    "channel": ("text or number", "-", "its channel, such as `can0`"),
    "bitrate": ("number", "-", "bits per second, of interfaces that set it"),
    "..": ("", "-", "whatever else that interface of python-can takes"),
}
DEVICE_OF_PORT = {
    "port": ("text", "", "a path such as `/dev/ttyUSB0`, a name such as `COM3`, or `usb:VID:PID[:SERIAL]`"),
    "baudrate": ("whole number", "", "bits per second, as set in the device"),
    "bytesize": ("whole number", "`8`", "data bits"),
    "parity": ("text", '`"N"`', "`N`, `E`, `O`, `M` or `S`"),
    "stopbits": ("number", "`1`", "stop bits"),
    "xonxoff": ("true or false", "`false`", "handshake by characters"),
    "rtscts": ("true or false", "`false`", "handshake by RTS and CTS"),
    "dsrdtr": ("true or false", "`false`", "handshake by DSR and DTR"),
    "low_latency": ("true or false", "`true`", "false leaves the driver's latency as it is"),
}
DEVICE_OF_OXYGEN = {
    "oxygen": ("text", "", "address of OXYGEN's remote control: `HOST` or `HOST:PORT`, 10001 if left out"),
    "stream_port": ("whole number", "`10003`", "port of the data stream that OXYGEN is to open for this program"),
    "group": ("whole number", "`1`", "number of the data stream's group, of which nobody else makes use"),
    "acquisition": ("true or false", "`false`", "whether OXYGEN's acquisition is started where it stands still"),
    "storing": ("true or false", "`false`", "whether OXYGEN's own recording is started, and stopped at the end"),
}
DEVICE_OF_OPENDAQ = {
    "opendaq": (
        "text",
        "",
        "address: `daq.nd://HOST[:PORT]` native, `daq.ns://` its stream alone, `daq.lt://` websocket, `daqref://device0`",
    ),
}
FRAMINGS = """\
## `[source.framing]`

A ready-made one with its parameters, and keys in place of its own; or `kind` and what that needs.
"""


def page() -> str:
    """Return the text of the page."""
    parts = [
        INTRODUCTION,
        section("Top of the file", "", [*_head()]),
        section(
            "`[mechanism]`",
            "What the identification needs must be there; what a virtual rig and the target `parameters` need "
            "beside it says so. A body on a line has none of a gun's, and an area or `bore_friction` only with a "
            "channel of that pressure's role. `u_<key>` may stand beside any of them: its standard uncertainty, in "
            "the same unit.",
            [*_mechanism()],
        ),
        section("`[[source]]`", _text(rig.Source), rows_of(rig.Source)),
        *(
            section(f'`align = {{ method = "{_method(model)}", .. }}`', _text(model), rows_of(model))
            for model in get_args(get_args(rig.Alignment)[0])
        ),
        section("`time` of a source", _text(rig.AbsoluteTime), rows_of(rig.AbsoluteTime)),
        section("`device` of a can source", "", [(key, *row) for key, row in DEVICE_OF_BUS.items()]),
        section("`device` of a serial source", "", [(key, *row) for key, row in DEVICE_OF_PORT.items()]),
        section("`device` of an OXYGEN recorder", "", [(key, *row) for key, row in DEVICE_OF_OXYGEN.items()]),
        section("`device` of an openDAQ recorder", "", [(key, *row) for key, row in DEVICE_OF_OPENDAQ.items()]),
        section("`[source.layout]` of a recorder", "A table of text that does not say so itself.", rows_of(TextLayout)),
        section("`[source.layout]` of a camera", "A table of tracks.", rows_of(TrackLayout)),
        section("`features` of a camera's layout", "At least one column each.", rows_of(DeclaredFeature)),
        FRAMINGS,
        *(_ready_made(name, build) for name, build in READY_MADE.items()),
        section("Keys of a framing", "", rows_of(framing.FramingTable, kinds=True)),
        *(
            section(title, _text(model), rows_of(model))
            for title, model in (
                ("`length`", framing.LengthTable), ("`checksum`", framing.ChecksumTable),
                ("`fields`", framing.FieldTable), ("`frames`", framing.FrameTable),
                ("`when`", framing.WhenTable), ("`tlv`", framing.TlvTable),
                ("`counter`", framing.CounterTable), ("`device_time`", framing.DeviceTimeTable),
                ("`poll`", framing.PollTable), ("`start_commands`, `stop_commands`", framing.CommandTable),
            )
        ),
        section("`[[channel]]`", _text(ChannelSpec), rows_of(ChannelSpec)),
        section("`[channel.sensor]`", "", rows_of(Sensor)),
        section("`gauge_ahead` of a breech gauge", _text(GaugeAhead), rows_of(GaugeAhead)),
        _quantities(),
        section("`[report]`", _text(issue.Issue), rows_of(issue.Issue)),
        section("`[knowledge]`", _text(knowledge.Knowledge), rows_of(knowledge.Knowledge)),
        section("`[knowledge.projectile]`", _text(knowledge.ProjectileImpulse), rows_of(knowledge.ProjectileImpulse)),
        section("`[[knowledge.load]]`", _text(knowledge.KnownLoad), rows_of(knowledge.KnownLoad)),
        section("`[trigger]`", "", rows_of(trigger._TriggerTable)),
        *(
            section(
                f'`[[trigger.any]]` of kind `{kind}`',
                "Levels are texts with their unit, such as `\"1.5 MPa\"`, or numbers in SI.", rows_of(model),
            )
            for kind, (model, _) in trigger._KINDS.items()
        ),
        section(
            "`[twin]`",
            "How every virtual rig measures, and what is drawn of it; a real stand has none.",
            rows_of(RecorderSettings),
        ),
        section("`[twin]` of a gun", "How it moves.", rows_beyond(TwinSettings, RecorderSettings)),
        section(
            "`[twin]` of a body on a line",
            "How it moves. Of `[twin.unread]` and `[twin.readings]` it has what does not need a gun.",
            rows_beyond(LineSettings, RecorderSettings),
        ),
        section("`[twin.unread]`", _text(UnreadForces), rows_of(UnreadForces)),
        section("`[twin.readings]`", _text(Readings), rows_of(Readings)),
    ]  # fmt: skip
    return "\n".join(parts)


Row = tuple[str, str, str, str]


def section(title: str, text: str, rows: Sequence[Row]) -> str:
    """Write a heading, a text and a table."""
    lines = [f"## {title}", "", *([text, ""] if text else [])]
    lines += ["| key | value | if left out | what it is |", "|---|---|---|---|"]
    lines += [f"| {' | '.join(_cell(cell) for cell in (f'`{row[0]}`', *row[1:]))} |" for row in rows]
    return "\n".join([*lines, ""])


def rows_of(model: type[BaseModel], *, kinds: bool = False) -> list[Row]:
    """Return a row per key of a model; with `kinds`, of a framing, with the kinds that have the key."""
    rows = []
    for name, field in model.model_fields.items():
        key = field.alias or name
        meaning = "; ".join(filter(None, (field.description, _begun_small(docstrings(model).get(name, "")))))
        if not meaning and get_origin(_plain(field.annotation)) is not Literal:
            raise ValueError(f"{model.__name__}.{name} has no meaning: give its field a description or a docstring")
        own = [kind for kind, keys in KEYS_OF_FRAMINGS.items() if key in keys]
        if kinds and own and len(own) < len(KEYS_OF_FRAMINGS):
            meaning += f" (of {', '.join(own)})"
        rows.append((key, kind_of(field), left_out(field), meaning))
    return rows


def rows_beyond(model: type[BaseModel], common: type[BaseModel]) -> list[Row]:
    """Return a row per key that a model has beyond what it is made from, or has otherwise."""
    there = rows_of(common)
    return [row for row in rows_of(model) if row not in there]


@cache
def docstrings(model: type[BaseModel]) -> dict[str, str]:
    """Return the docstrings that stand below the fields of a class and of those that it is made from."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if not issubclass(base, BaseModel) or base is BaseModel:
            continue
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        body = tree.body if isinstance(tree, ast.ClassDef) else []
        for field, below in pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
                if is_text and isinstance(below.value.value, str):  # type: ignore[attr-defined]
                    found[field.target.id] = " ".join(below.value.value.split())  # type: ignore[attr-defined]
    return found


def _begun_small(sentence: str) -> str:
    """Write a sentence as a cell goes on: a small letter first, unless its word is a symbol, and no full stop."""
    first = sentence[:2]
    text = sentence[:1].lower() + sentence[1:] if first[1:].islower() or first[1:] == " " else sentence
    return text.removesuffix(".")


def kind_of(field: FieldInfo) -> str:
    """Say what a key takes."""
    return _kind(field.annotation, tuple(field.metadata))


def _kind(annotation: Any, metadata: tuple[Any, ...] = ()) -> str:
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *more = get_args(annotation)
        return _kind(inner, (*_flat(more), *metadata))
    if origin is Literal:
        *others, last = (f"`{_toml(value)}`" for value in get_args(annotation))
        return f"{', '.join(others)} or {last}" if others else last
    arguments = get_args(annotation)
    if origin in (list, tuple):
        inner = next((one for one in arguments if one is not Ellipsis), str)
        is_pair = origin is tuple and len(arguments) == 2 and arguments[1] is inner
        return "array of 2 numbers" if is_pair else f"array of {_plural(_kind(inner))}"
    if origin is dict or (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
        return "table"
    if arguments and origin is not None:
        return " or ".join(dict.fromkeys(_kind(one, metadata) for one in arguments if one is not NoneType))
    if choices := _choices(metadata):
        return choices
    words = {float: "number", int: "whole number", str: "text", bytes: "text", bool: "true or false", dt.date: "date"}
    return words[annotation] + _bounds(metadata)


def _choices(metadata: Iterable[Any]) -> str:
    """Return the words that a validator of one of several lets pass; empty if there is none."""
    for one in metadata:
        if isinstance(one, BeforeValidator) and "_one_of" in getattr(one.func, "__qualname__", ""):
            (words,) = (cell.cell_contents for cell in one.func.__closure__ or ())
            return ", ".join(f"`{word}`" for word in words)
    return ""


def _bounds(metadata: Iterable[Any]) -> str:
    texts = []
    for one in metadata:
        for sign, name in ((">", "gt"), ("from", "ge"), ("<", "lt"), ("to", "le")):
            value = getattr(one, name, None)
            if isinstance(value, int | float) and abs(value) < 1e9:
                texts.append(f"{sign} {value:g}")
    return f" {' '.join(texts)}" if texts else ""


def _flat(metadata: Iterable[Any]) -> list[Any]:
    """Take the bounds out of what `Field` makes of them."""
    found = []
    for one in metadata:
        found += one.metadata if isinstance(one, FieldInfo) else [one]
    return found


def _plural(kind: str) -> str:
    return {"text": "texts", "number": "numbers", "table": "tables", "whole number": "whole numbers"}.get(kind, kind)


def left_out(field: FieldInfo) -> str:
    """Say what counts where a key is left out."""
    if field.default is PydanticUndefined and field.default_factory is None:
        return ""
    if field.default in (None, "", (), []) or isinstance(field.default, BaseModel) or field.default_factory is not None:
        return "-"
    return f"`{_toml(field.default)}`"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(one) for one in value)}]"
    escaped = str(value).replace("\\", "\\\\").replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"' if isinstance(value, str) else str(value)


def _plain(annotation: Any) -> Any:
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return annotation


def _cell(text: str) -> str:
    return " ".join(text.replace("``", "`").replace("|", "\\|").split())


def _text(model: type[BaseModel]) -> str:
    """Return the first paragraph of a model's docstring."""
    return " ".join(inspect.cleandoc(model.__doc__ or "").split("\n\n")[0].replace("``", "`").split())


def _method(model: type[BaseModel]) -> str:
    return str(get_args(model.model_fields["method"].annotation)[0])


def _head() -> Iterable[Row]:
    yield "schema", f'`"{SCHEMA}"`', "", "what kind of file this is"
    for key, meaning in HEAD.items():
        yield key, "text", "", meaning


def _mechanism() -> Iterable[Row]:
    models = " or ".join(f'`"{one}"`' for one in MechanismModel)
    yield MODEL, models, f'`"{MechanismModel.GUN}"`', "what moves: the three bodies of a gun, or one body on a line"
    defaults = {one.name: one.default for one in dataclasses.fields(Mechanism)}
    for key in Mechanism.symbols():
        default, needed = defaults[key], key in Gun.required()
        bounds = "number > 0" if key in Mechanism.POSITIVE else "number"
        of_gun = " (of a gun)" if key in Mechanism.OF_GUN else ""
        virtual = not needed and isinstance(default, float) and math.isnan(default)
        without = "" if needed else "virtual rigs need it" if virtual else f"`{default:g}`"
        yield key, bounds, without, MEANINGS[key] + of_gun


def _quantities() -> str:
    """Write which units each quantity may be in, and which quantity each role has."""
    roles: dict[str, list[str]] = {}
    for role, quantity in rig.ROLES.items():
        roles.setdefault(quantity, []).append(f"`{role}`")
    lines = ["## Quantities, their units and roles", "", "| quantity | units | roles |", "|---|---|---|"]
    for quantity in SI_UNITS:
        units = ", ".join(f"`{name}`" for name, unit in UNITS.items() if quantity in unit.quantities)
        lines.append(f"| `{quantity}` | {units} | {', '.join(roles.get(quantity, []))} |")
    spellings = "`m/s2`, `m/s²`, `m/s**2`, `ms⁻²` and `m/s^2` are one, as are `µ` and `u`; `°` is `deg`. Case counts."
    return "\n".join([*lines, "", spellings, ""])


def _ready_made(name: str, build: Callable[..., Any]) -> str:
    """Write what a ready-made framing is, and its parameters, from its docstring."""
    text = inspect.cleandoc(build.__doc__ or "")
    head, _, behind = text.partition("Parameters\n----------\n")
    what = " ".join(head.split("\n\n")[0].split())
    meanings: dict[str, str] = {}
    for keys, meaning in re.findall(r"^([\w, ]+)\n((?: {4}.*\n?)+)", behind, re.MULTILINE):
        meanings |= dict.fromkeys((key.strip() for key in keys.split(",")), " ".join(meaning.split()))
    lines = [f"### `{name}`", "", what.replace("``", "`"), ""]
    parameters = inspect.signature(build).parameters.values()
    if missing := [one.name for one in parameters if one.name not in meanings]:
        raise ValueError(f"the parameters {', '.join(missing)} of {name} have no meaning in its docstring")
    if parameters:
        lines += ["| parameter | if left out | what it is |", "|---|---|---|"]
        lines += [
            f"| `{one.name}` | {f'`{_toml(one.default)}`' if one.default != () else '-'} "
            f"| {_cell(_begun_small(meanings[one.name]))} |"
            for one in parameters
        ]
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
