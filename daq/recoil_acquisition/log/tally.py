"""Losses of a log, from the numbers of the records that are there."""

from __future__ import annotations

from dataclasses import dataclass, field

from recoil_acquisition.log.record import OWN, Kind, Record
from recoil_acquisition.log.writer import WHOLE, Released


@dataclass(frozen=True)
class Loss:
    """Records of one source that were written, not released, and are not there.

    Attributes
    ----------
    first, last
        Numbers of the records within the source.
    bytes
        Bytes of the payloads.
    from_ns, until_ns
        Instants of the host between which the content arrived; None if nothing of the source is there before or behind.
    """

    source: int
    first: int
    last: int
    bytes: int
    from_ns: int | None
    until_ns: int | None

    @property
    def records(self) -> int:
        """Number of records."""
        return self.last - self.first + 1


@dataclass
class _Counted:
    """Progress of a source."""

    number: int = 0
    position: int | None = 0
    host_ns: int | None = None


@dataclass
class Tally:
    """Counts the records of a log as they pass, in the order of their numbers.

    Attributes
    ----------
    records
        Number of records that passed.
    closed
        Whether the log says that it ended in order.
    """

    records: int = 0
    closed: bool = False
    _counted: dict[int, _Counted] = field(default_factory=dict)
    _gaps: list[Loss] = field(default_factory=list)
    _released: Released = field(default_factory=Released)

    def begin(self, source: int, number: int) -> None:
        """Count a source from a number on, unless it is counted already: what came before is no loss."""
        self._counted.setdefault(source, _Counted(number, None))

    def reach(self, source: int, number: int) -> None:
        """Count what is missing of a source, that has begun, before a number."""
        position = self._counted[source].position or 0
        self._step(source, number, position, number, position, None)

    def take(self, record: Record) -> None:
        """Count one record."""
        self.records += 1
        size = len(record.payload)
        self._step(WHOLE, record.number, 0, record.number + 1, 0, record)
        self._step(
            record.source, record.source_number, record.position,
            record.source_number + 1, record.position + size, record,
        )  # fmt: skip
        if record.source != OWN:
            return
        if record.kind == Kind.RELEASED:
            self._released = Released.from_json(record.said)
        elif record.kind == Kind.CLOSED:
            self.closed = True
            for source, (number, position) in record.said["sources"].items():
                self._step(int(source), number, position, number, position, None)

    @property
    def losses(self) -> tuple[Loss, ...]:
        """Records of each source that are missing, apart from those that were released."""
        return tuple(loss for gap in self._gaps if gap.source != WHOLE for loss in self._unreleased(gap))

    @property
    def lost_records(self) -> int:
        """Number of records missing before the last that is there, or that the log says there are."""
        within = sum(loss.records for gap in self._gaps if gap.source == WHOLE for loss in self._unreleased(gap))
        return max(within, sum(loss.records for loss in self.losses))

    @property
    def released_records(self) -> int:
        """Number of records that were released and are no longer there."""
        gaps = [gap for gap in self._gaps if gap.source == WHOLE]
        return sum(gap.records - sum(one.records for one in self._unreleased(gap)) for gap in gaps)

    def _step(
        self, source: int, number: int, position: int, next_number: int, next_position: int, record: Record | None
    ) -> None:
        """Note what is missing of a source before a number, and go on behind it."""
        counted = self._counted.setdefault(source, _Counted())
        if number > counted.number:
            until_ns = None if record is None else record.from_ns
            missing = 0 if counted.position is None else position - counted.position
            self._gaps.append(Loss(source, counted.number, number - 1, missing, counted.host_ns, until_ns))
        counted.number, counted.position = max(counted.number, next_number), max(counted.position or 0, next_position)
        if record is not None:
            counted.host_ns = record.host_ns

    def _unreleased(self, gap: Loss) -> list[Loss]:
        """Return what of a gap was not released."""
        left, begin, size = [], gap.first, gap.bytes
        for first, last, released in self._released.of(gap.source):
            if last < gap.first or first > gap.last:
                continue
            if first > begin:
                left.append((begin, first - 1))
            begin = last + 1
            size -= released
        if begin <= gap.last:
            left.append((begin, gap.last))
        sizes = [max(size, 0) if i == 0 else 0 for i in range(len(left))]
        return [
            Loss(gap.source, first, last, bytes_lost, gap.from_ns, gap.until_ns)
            for (first, last), bytes_lost in zip(left, sizes, strict=True)
        ]
