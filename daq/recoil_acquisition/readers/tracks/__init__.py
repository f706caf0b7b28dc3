"""Camera tracks: exports of tracking programs, as text, workbook and HDF5."""
