"""HDF5 files with measured channels."""
