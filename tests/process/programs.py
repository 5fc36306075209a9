"""What every process test needs: the programs, a deadline, the shipped scenes, the outcome as a dictionary."""

import json
import os
import pathlib
import signal
import subprocess
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("HAMEL_BIN", ROOT / "build/release/bin"))
SCENES = ROOT / "deploy/scenes"
DEADLINE_S = 100


def scene(name):
    return str(SCENES / f"{name}.textproto")


def hamel(*args, deadline_s=DEADLINE_S):
    """Runs `hamel ARGS` to its end: (exit code, stdout, stderr)."""
    done = subprocess.run([BIN / "hamel", *map(str, args)], capture_output=True, text=True, timeout=deadline_s)
    return done.returncode, done.stdout, done.stderr


def outcome(*args, deadline_s=DEADLINE_S):
    """Runs `hamel ARGS --json`: (exit code, the JSON object)."""
    code, out, err = hamel(*args, "--json", deadline_s=deadline_s)
    if not out.strip():
        raise AssertionError(f"no JSON; exit code {code}; stderr:\n{err}")
    return code, json.loads(out)


class Up:
    """A running `hamel up ... --json` whose children can be found by name."""

    def __init__(self, *args):
        self.process = subprocess.Popen(
            [BIN / "hamel", "up", *map(str, args), "--json"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)

    def child(self, service, deadline_s=20):
        """The pid of hamel-SERVICE under this supervisor, waiting for it to exist."""
        end = time.monotonic() + deadline_s
        while time.monotonic() < end:
            found = subprocess.run(["pgrep", "-P", str(self.process.pid), "-f", f"hamel-{service} "],
                                   capture_output=True, text=True).stdout.split()
            if found:
                return int(found[0])
            if self.process.poll() is not None:
                raise AssertionError(f"hamel up ended early:\n{self.process.communicate()}")
            time.sleep(0.02)
        raise AssertionError(f"hamel-{service} did not start in {deadline_s} s")

    def end(self, deadline_s=DEADLINE_S):
        """Waits for the end: (exit code, JSON object or None, stderr)."""
        try:
            out, err = self.process.communicate(timeout=deadline_s)
        except subprocess.TimeoutExpired:
            self.kill()
            raise
        return self.process.returncode, json.loads(out) if out.strip() else None, err

    def kill(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(5)
            except subprocess.TimeoutExpired:
                self.process.kill()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()
        self.process.stdout.close()
        self.process.stderr.close()


def main():
    unittest.main(verbosity=2)
