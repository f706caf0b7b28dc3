"""The one record format: what live acquisition received, appended by `writer`, read back by `folder`; see `record`."""
