#!/usr/bin/env python3
"""Several arms on one domain: in processes side by side, and in one process."""

import json
import os
import re
import signal
import subprocess
import tempfile
import time
import unittest

from programs import BIN, ROOT, Up, hamel, main, scene

GYRO = ["--set", "planner.method=gyro"]


def arm_state(arm, domain):
    """The newest state of one arm of several on a domain."""
    end = time.monotonic() + 30
    while time.monotonic() < end:
        code, out, err = hamel("topic", "echo", "state", "--count", 4, "--json", "--domain", domain)
        for line in out.splitlines():
            state = json.loads(line)
            if state["arm"] == arm:
                return state
    raise AssertionError(f"nothing of arm {arm}: {err}")


class SideBySide(unittest.TestCase):
    def test_two_runs_on_one_domain_do_not_meet(self):
        domain = ["--domain", 110]
        with Up(scene("four_link_avoid"), *GYRO, "--set", "arm=1", "--duration", 25, *domain) as one, \
             Up(scene("panda_reach"), *GYRO, "--set", "arm=2", "--duration", 25, "--bus", "fastdds", *domain) as two:
            one.child("dynamics"), two.child("dynamics")
            ends = [one.end(), two.end()]
        for code, o, err in ends:
            self.assertEqual((code, o["outcome"], o["contacts"], o["restarts"]), (0, "REACHED", 0, 0), err)
            self.assertNotIn("another", err)


class Together(unittest.TestCase):
    def test_an_arm_that_fails_holds_no_other_up(self):
        """The second of two arms meets one of its key that was there before, and ends."""
        with tempfile.TemporaryDirectory() as folder:
            second = os.path.join(folder, "second.textproto")
            with open(scene("four_link_avoid")) as f, open(second, "w") as out:
                text = re.sub(r'urdf: "\.\./', f'urdf: "{ROOT}/deploy/', f.read())
                out.write("arm: 2\n" + text)
            start = lambda *scenes: subprocess.Popen([BIN / "hamel-dynamics", *scenes, "--domain", "111"], stderr=subprocess.PIPE, text=True)
            there = start(second)
            both = None
            try:
                old = arm_state(2, 111)
                while arm_state(2, 111)["t_s"] < old["t_s"] + 4:  # young arms give way
                    pass
                both = start(scene("four_link_avoid"), second)
                first = arm_state(1, 111)["step"]
                self.assertGreater(arm_state(1, 111)["step"], first)
                self.assertEqual(arm_state(2, 111)["incarnation"], old["incarnation"])
                self.assertIsNone(both.poll(), "it goes on with its first arm")
                both.send_signal(signal.SIGTERM)
                _, err = both.communicate(timeout=20)
                self.assertEqual(both.returncode, 2, err)
                self.assertIn("arm 2 runs already", err)
            finally:
                for p in (there, both):
                    if p:
                        p.kill()
                        p.communicate()


class Stopped(unittest.TestCase):
    def test_periods_that_were_missed_are_counted(self):
        with Up(scene("four_link_avoid"), *GYRO, "--set", "stop=at_duration", "--duration", 4, "--domain", 112) as up:
            pid = up.child("dynamics")
            arm_state(1, 112)
            os.kill(pid, signal.SIGSTOP)
            time.sleep(0.3)
            os.kill(pid, signal.SIGCONT)
            code, o, err = up.end()
        self.assertEqual(o["steps"], 4000, err)
        self.assertIn(o["deadlines_missed"], range(280, 3000), "300 and what a busy machine adds")


if __name__ == "__main__":
    main()
