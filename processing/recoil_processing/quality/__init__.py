"""All checks of one channel, one track or several shots.

Each is a small function that returns ``(verdict, detail)``; the detail gives the figure, the limit and what to
do before the next shot, in words for the person at the range. All limits and their sources stand in
`recoil_processing.quality.limits.LIMITS`.
"""
