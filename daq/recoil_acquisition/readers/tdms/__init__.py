"""TDMS files of National Instruments' programs."""
