"""The shot logs of a campaign: what they say of its shots now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog, ShotLogRow
from recoil_daq.campaign_sources import Source
from recoil_identification.campaign.campaign_shot import CampaignShot


@dataclass(frozen=True, eq=False)
class CampaignLogs:
    """The shot logs of a campaign.

    Attributes
    ----------
    given
        The one for all shots, if one is given.
    read
        Each log that is there, by its path.
    """

    given: Path | None
    read: Mapping[Path, ShotLog]

    @classmethod
    def of(cls, given: Path | None, sources: Sequence[Source]) -> CampaignLogs:
        """Read the log that is given, or those beside the shot files."""
        if given is not None:
            if not given.exists():
                raise ReadError("no such file", path=given, remedy="check the name and the folder")
            return cls(given, {given: ShotLog.read(given)})
        beside = dict.fromkeys(one.shot_file.parent / SHOT_LOG for one in sources if one.shot_file is not None)
        logs = {path: ShotLog.read(path) for path in beside}
        return cls(None, {path: log for path, log in logs.items() if log.sha256 is not None})

    def applied(self, source: Source, shot: CampaignShot) -> CampaignShot:
        """Take what the log says of a shot, instead of what it said when the shot was identified."""
        path = self.given
        if path is None and source.shot_file is not None:
            path = source.shot_file.parent / SHOT_LOG
        log = None if path is None else self.read.get(path)
        if log is None:
            return shot
        row = log.row(shot.name) or ShotLogRow(shot.name)
        if row.added_mass_kg >= shot.mass_kg:
            raise ReadError(
                f"{row.added_mass_kg:g} kg are added in shot {shot.name}, whose whole mass is {shot.mass_kg:.1f} kg",
                path=log.path, remedy="correct `added_mass_kg` in the shot log",
            )  # fmt: skip
        return replace(
            shot,
            configuration=row.configuration,
            added_mass_kg=row.added_mass_kg,
            u_added_mass_kg=row.u_added_mass_kg,
            excluded=row.exclude,
            log=row.to_json(),
        )

    def strangers(self, names: Sequence[str]) -> list[str]:
        """Say which rows are of no shot at all."""
        return [
            f"{path}: shot {name} is in the shot log, but there is no such shot"
            for path, log in self.read.items()
            for name in log.without_shot([*names, *log.shots])
        ]
