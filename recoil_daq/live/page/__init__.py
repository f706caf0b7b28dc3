"""The pages of a day at the range: files that a browser opens from a disk, a share, a stick or any server."""
