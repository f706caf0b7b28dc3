"""Recordings: the nouns of a recording and the readers of the instruments' own formats.

Vocabulary, used with these meanings throughout the project:

clock
    What stamps a source. Each recorder, bus and camera has one, named like its source.
time base
    Instants on one clock: uniform (start, step, count) or stamped (one instant per sample).
channel
    One measured time series of one quantity on one time base, SI samples, shape ``(n_samples,)``.
    A sample that the instrument lost is NaN; it is never zero and never filled.
track
    One camera marker's path, metres, shape ``(n_frames, n_axes)``.
recording
    One opened file of one instrument: headers first, samples when asked for.
shot
    One firing, assembled from recordings: channels on their own clocks, and how the clocks relate.

Nothing in here knows a rig, a filter or a mass.
"""
