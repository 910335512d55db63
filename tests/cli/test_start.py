"""An interruption before a command has begun ends as one after it has: one line, exit code 130."""

import os
import signal
import subprocess
import sys

import pytest
from support.waiting import PATIENCE

from cfem.cli.run import run_command

SLOWLY = """
import sys, time, cfem.__main__ as start

class Slow:
    def find_spec(self, name, *rest):
        if name == "cfem.cli.app":
            print("importing", flush=True)
            time.sleep(60)

sys.meta_path.insert(0, Slow())
start.main()
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_while_it_imports(how):
    words = [sys.executable, "-c", SLOWLY]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "importing\n"
        process.send_signal(how)
        assert process.communicate(timeout=PATIENCE) == ("", "cfem: interrupted\n") and process.returncode == 130


def test_the_script_starts_there():
    done = subprocess.run([sys.executable, "-m", "cfem", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() and not done.stderr


def test_what_compiled_code_makes_of_an_interrupt_is_one():
    def work(_):
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None

    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    try:
        with pytest.raises(SystemExit) as left:
            run_command(work)
    finally:
        for number, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
            signal.signal(number, handler)
    assert left.value.code == 130


def test_an_interrupt_after_the_work_does_not_undo_what_is_said(capsys):
    """Sent while the outcome is printed."""

    class Late(str):
        def __str__(self):
            os.kill(os.getpid(), signal.SIGINT)
            return "done"

    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    try:
        run_command(lambda _: Late())
    finally:
        for number, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
            signal.signal(number, handler)
    assert capsys.readouterr().out == "done\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no device that is always full")
@pytest.mark.parametrize(
    "words",
    [
        pytest.param(["--help"], marks=pytest.mark.slow),
        pytest.param(["--version"], marks=pytest.mark.slow),
        ["schema", "--out", "made"],
    ],
    ids=" ".join,
)
def test_a_summary_that_meets_a_full_disk_is_one_sentence(words, tmp_path):
    with open("/dev/full", "w") as full:
        words = [sys.executable, "-m", "cfem", *words]
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, cwd=tmp_path)
    assert done.returncode == 7 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("cfem: stdout: cannot write: No space left on device")


def test_a_reader_that_has_gone_is_no_error_to_report():
    process = subprocess.Popen([sys.executable, "-m", "cfem", "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert process.stderr.read() == b"" and process.wait() == 1
    process.stderr.close()
