import os
import subprocess
import sys

import pytest

INTERRUPTS = "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(1)\n"
SWALLOWS = f"try:\n    exec({INTERRUPTS!r})\nexcept BaseException:\n    pass\n"
COMMAND = """
import signal
import time
import click
from kickdyn.door import run

@click.command("kick")
def kick():
    import package
    time.sleep(20)
    print("it went on")

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run behind a shell
run(kick)
"""


@pytest.mark.parametrize("package", [INTERRUPTS, SWALLOWS], ids=["lets it pass", "swallows it"])
def test_ctrl_c_ends_an_import(package, tmp_path):
    """Trimesh and others take whatever an import raises for a package that is not there."""
    (tmp_path / "package.py").write_text(package)
    path = os.pathsep.join([str(tmp_path), *sys.path])
    ended = subprocess.run(
        [sys.executable, "-c", COMMAND],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.strip() == "kick: interrupted"


@pytest.mark.parametrize("package", ["click", "numpy"])
@pytest.mark.parametrize("module", ["posture_sweep", "plan", "tradeoff", "view", "paper"])
def test_ctrl_c_ends_a_modules_own_imports(module, package, tmp_path):
    """`python -m kickdyn.plan` as well as the script, whatever is under way."""
    (tmp_path / f"{package}.py").write_text("raise KeyboardInterrupt")
    asked = ["--flight"] if module == "tradeoff" else ["--help"]
    ended = subprocess.run(
        [sys.executable, "-m", f"kickdyn.{module}", *asked],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.strip() == f"{module.replace('_', '-')}: interrupted"
