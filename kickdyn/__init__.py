"""kickdyn: what happens when a leg strikes a ball, and where the ball goes.

`__init__.pyi` lists the public names and the files that define them. Each is imported when it is
first used, so `import kickdyn` is quick and loads neither Pinocchio nor numba.
"""

import os

import lazy_loader

from kickdyn._version import __version__ as __version__

# A .numba_config.yaml in the working directory must not decide where machine code is read from.
os.environ.setdefault("NUMBA_CACHE_DIR", "")
os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", "")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
