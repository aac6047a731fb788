import subprocess
import sys

COMMAND = """
import os
import signal
import click
from kickdyn.cli.command import run

@click.command("kick")
def kick():
    os.kill(os.getpid(), signal.SIGINT)
    print("it went on")

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run behind a shell
run(kick)
"""


def test_ctrl_c_ends_a_command_in_one_line():
    ended = subprocess.run(
        [sys.executable, "-c", COMMAND], capture_output=True, text=True, timeout=60
    )
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.strip() == "kick: interrupted"
