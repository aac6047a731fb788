"""One kick from every posture of a grid, as an xarray dataset in memory or in a Zarr store.

Start with `sweep.py`, whose function `sweep` is the method. `chunk_solver.py` computes a range of
postures, by `kernel.py` at once or one by one by `sweep_kick.py`. The kernel goes from the posture
to the joint-space inertia (`robot/tree_kernel.py`) and from there to the impulse
(`impact/strike_kernel.py`). `queries.py` has what xarray does not have, and summaries.
"""
