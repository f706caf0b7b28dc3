"""The shot file: written, verified and read back by `shot_file`, its tree described in `layout`."""

from recoil_acquisition.store.shot_file import (
    is_shot_file,
    read_shot,
    recorded_files,
    shot_file_of,
    shot_summary,
    write_shot,
)

__all__ = ["is_shot_file", "read_shot", "recorded_files", "shot_file_of", "shot_summary", "write_shot"]
