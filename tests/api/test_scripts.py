"""Programs as a user writes them, run as such."""

import subprocess
import sys

import numpy as np

import cfem

PLAIN = """
import cfem

print("begins")
print(cfem.run_stage("sample", "pipelines/bar/sample.yaml", out="again", workers=2)["status"])
"""


def test_a_plain_script_samples_without_a_guard_and_runs_once(bar, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(PLAIN)
    done = subprocess.run([sys.executable, str(script)], cwd=bar, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["begins", "done"] and "Traceback" not in done.stderr
    again, before = (cfem.read_dataset(bar / folder) for folder in ("again", "data/bar/samples"))
    np.testing.assert_array_equal(again.W, before.W)
