import os
import signal
import subprocess
import sys

import pytest

from kickdyn.core.interrupt import held


@pytest.fixture
def heard():
    """SIGINT as Python has it, which is ignored where tests run behind a shell."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_waits_however_often_it_comes(heard):
    waiting, done = held(), []
    with pytest.raises(KeyboardInterrupt), waiting:
        done = [os.kill(os.getpid(), signal.SIGINT) for _ in range(3)]
    assert len(done) == 3
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_without_one_nothing_is_raised(heard):
    with held():
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_is_started_meanwhile_does_not_hear_it(heard):
    code = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    with held():
        said = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert said.strip() == "True"
