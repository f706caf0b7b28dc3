"""Shot files that somebody made to do harm: what they lead to, and what they say that is not so."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

SIGNAL = "entry/dewetron/acc_recoil"
SECRET = b"the-secret-marker-of-another-file"


def secret_files(folder: Path) -> None:
    """Write a file of plain bytes and one of HDF5, which hold `SECRET` and which no shot file may lead to."""
    (folder / "secret.bin").write_bytes(SECRET * 4096)
    with h5py.File(folder / "secret.h5", "w") as file:
        file["text"] = SECRET.decode()
        file["numbers"] = np.frombuffer(SECRET * 8, dtype="u1").astype("f8")


def _beside(file: Any, name: str) -> str:
    return str(Path(file.filename).parent / name)


def _external_link(file: Any) -> None:
    del file["entry/rig/text"]
    file["entry/rig/text"] = h5py.ExternalLink(_beside(file, "secret.h5"), "/text")


def _external_group(file: Any) -> None:
    del file["entry/rig"]
    file["entry/rig"] = h5py.ExternalLink(_beside(file, "secret.h5"), "/")


def _external_storage(file: Any) -> None:
    shape, attributes = file[SIGNAL].shape, dict(file[SIGNAL].attrs)
    del file[SIGNAL]
    made = file.create_dataset(SIGNAL, shape, "f8", external=[(_beside(file, "secret.bin"), 0, h5py.h5f.UNLIMITED)])
    _again(made, attributes)


def _virtual(file: Any) -> None:
    shape, attributes = file[SIGNAL].shape, dict(file[SIGNAL].attrs)
    del file[SIGNAL]
    layout = h5py.VirtualLayout(shape, "f8")
    source = h5py.VirtualSource(_beside(file, "secret.h5"), "numbers", shape=(len(SECRET) * 8,))
    count = min(shape[0], len(SECRET) * 8)
    layout[:count] = source[:count]
    _again(file.create_virtual_dataset(SIGNAL, layout, fillvalue=0.0), attributes)


def _again(made: Any, attributes: dict[str, Any]) -> None:
    for key, value in attributes.items():
        if key not in ("DIMENSION_LIST", "REFERENCE_LIST"):
            made.attrs[key] = value


def _soft_link(file: Any) -> None:
    file["entry/soft"] = h5py.SoftLink("/entry")


def _cycle(file: Any) -> None:
    file["entry/dewetron/again"] = file["entry"]


def _deep(file: Any) -> None:
    group = file["entry"]
    for _ in range(3000):
        group = group.create_group("g")


def _many_attributes(file: Any) -> None:
    # in an object's old form they would have to fit its header
    group = h5py.File(file.filename + ".new", "w", libver="latest")
    for k in range(5000):
        group.attrs[f"a{k}"] = float(k)
    file.copy(group["/"], "entry/many")
    group.close()
    Path(file.filename + ".new").unlink()


def _many_groups(file: Any) -> None:
    for k in range(60_000):
        h5py.h5g.create(file.id, f"g{k}".encode())


def _huge_shape(file: Any) -> None:
    attributes = dict(file[SIGNAL].attrs)
    del file[SIGNAL]
    _again(file.create_dataset(SIGNAL, (1 << 40,), "f8", chunks=(1024,)), attributes)


def _large_shapes(file: Any) -> None:
    for k in range(40):
        file.create_dataset(f"entry/dewetron/c{k}", (1 << 20,), "f8", chunks=(1024,))


def _two_axes(file: Any) -> None:
    attributes = dict(file[SIGNAL].attrs)
    del file[SIGNAL]
    _again(file.create_dataset(SIGNAL, data=np.zeros((3, 4))), attributes)


def _huge_chunk(file: Any) -> None:
    attributes = dict(file[SIGNAL].attrs)
    del file[SIGNAL]
    _again(file.create_dataset(SIGNAL, (10,), "f8", maxshape=(None,), chunks=(1 << 28,)), attributes)


def _bomb(file: Any) -> None:
    """A chunk of 8 kB, which is stored as a megabyte that gives a gigabyte."""
    import zlib

    # every mebibyte of nothing is compressed to the same bytes, so one of them is
    raw = zlib.compressobj(1, wbits=-zlib.MAX_WBITS)
    mebibyte = raw.compress(bytes(1 << 20)) + raw.flush(zlib.Z_FULL_FLUSH)
    adler = ((1 << 30) % 65521 << 16) + 1
    attributes = dict(file[SIGNAL].attrs)
    del file[SIGNAL]
    made = file.create_dataset(SIGNAL, (1024,), "f8", chunks=(1024,), compression="gzip")
    made.id.write_direct_chunk((0,), b"\x78\x01" + 1024 * mebibyte + b"\x03\x00" + adler.to_bytes(4, "big"))
    _again(made, attributes)


def _many_names_of_one_text(file: Any) -> None:
    """A column of texts that are all the same megabyte."""
    del file["entry/quality/detail"]
    made = file.create_dataset("entry/quality/detail", (20_000,), h5py.string_dtype())
    made[0] = "x" * (1 << 20)
    offset = made.id.get_offset()
    file.flush()
    with open(file.filename, "r+b") as stream:  # noqa: PTH123 - while h5py has it open
        stream.seek(offset)
        reference = stream.read(16)
        stream.seek(offset)
        stream.write(reference * 20_000)


def _huge_attribute(file: Any) -> None:
    for k in range(200):
        file[SIGNAL].attrs[f"a{k}"] = np.bytes_(b"x" * 60_000)


def _foreign_filter(file: Any) -> None:
    attributes = dict(file[SIGNAL].attrs)
    del file[SIGNAL]
    _again(file.create_dataset(SIGNAL, data=np.zeros(100), compression="lzf"), attributes)


def _identifier(value: Any) -> Callable[..., None]:
    def craft(file: Any) -> None:
        del file["entry/entry_identifier"]
        file["entry/entry_identifier"] = value

    return craft


def _text(path: str, value: str) -> Callable[..., None]:
    def craft(file: Any) -> None:
        file[path][()] = value

    return craft


def _attribute(path: str, key: str, value: Any) -> Callable[..., None]:
    def craft(file: Any) -> None:
        file[path].attrs[key] = value

    return craft


CRAFTED: dict[str, Callable[..., None]] = {
    "external link": _external_link,
    "external group": _external_group,
    "external storage": _external_storage,
    "virtual data set": _virtual,
    "soft link": _soft_link,
    "cycle": _cycle,
    "many attributes": _many_attributes,
    "many groups": _many_groups,
    "deep groups": _deep,
    "huge shape": _huge_shape,
    "large shapes": _large_shapes,
    "two axes": _two_axes,
    "huge chunk": _huge_chunk,
    "bomb": _bomb,
    "one text many times": _many_names_of_one_text,
    "huge attributes": _huge_attribute,
    "foreign filter": _foreign_filter,
    "identifier of bytes": _identifier(np.bytes_(b"\xff\xfe\x80")),
    "identifier of a number": _identifier(7.0),
    "identifier of a list": _identifier(["a", "b"]),
    "identifier that leads out": _identifier("../../x"),
    "verdict": _text("entry/quality/verdict", "odd"),
    "deep JSON": _text("entry/history/step_1/parameters", "[" * 200_000),
    "parameters of a list": _text("entry/history/step_1/parameters", "[]"),
    "order that is not finite": _attribute(SIGNAL, "order", np.inf),
    "order of a text": _attribute(SIGNAL, "order", "first"),
    "uncertainty of a text": _attribute(SIGNAL, "u_rel", "small"),
    "quantity": _attribute(SIGNAL, "quantity", "odd"),
    "rate of a text": _attribute("entry/dewetron/time", "rate_hz", "fast"),
    "step": _attribute("entry/dewetron/time", "step_s", np.nan),
}
"""How each is made from a sound shot file that is open for writing; two others are beside it."""


def wrong_types(file: Any) -> list[tuple[str, Any]]:
    """List what to put in place of each dataset of a shot file: a number for a text, a text for a number, a group."""
    found: list[tuple[str, Any]] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            is_text = h5py.check_string_dtype(item.dtype) is not None
            found.extend([(name, 5.0 if is_text else "five"), (name, np.zeros((2, 2))), (name, None)])

    file.visititems(visit)
    return found


def craft(sound: Path, path: Path, how: Callable[..., None]) -> Path:
    """Make a hostile file of a sound one."""
    secret_files(path.parent)
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        how(file)
    return path


def replace_item(sound: Path, path: Path, name: str, value: Any) -> Path:
    """Put something else in place of a dataset; a group for None."""
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        attributes = dict(file[name].attrs)
        del file[name]
        if value is None:
            file.create_group(name)
        else:
            file[name] = value
            _again(file[name], attributes)
    return path
