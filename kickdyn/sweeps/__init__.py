"""One kick from every posture of a grid, as an xarray dataset in memory or in a Zarr store.

Start with `sweep.py`, whose function `sweep` is the method; `queries.py` has what xarray has not.
"""
