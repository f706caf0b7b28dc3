"""Figures of a shot and of a campaign: as plain arrays, as SVG, and for plotly's script."""
