#!/usr/bin/env python3
"""A planner in C, written from the IDL and idlc's output alone, drives the arm of either vendor."""

import pathlib
import subprocess
import tempfile
import unittest

from programs import BIN, ROOT, main, scene

GOAL = ["0.4", "0.3", "-0.2", "0.5"]


class Foreign(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        build = pathlib.Path(cls.folder.name)
        for command in (["cmake", "-S", ROOT / "tests/consumer/planner", "-B", build], ["cmake", "--build", build]):
            done = subprocess.run(command, capture_output=True, text=True, timeout=300)
            if done.returncode:
                raise AssertionError(done.stdout + done.stderr)
        cls.planner = build / "foreign_planner"

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def drives(self, vendor, pace, domain):
        arm = subprocess.Popen([BIN / "hamel-dynamics", scene("four_link_avoid"), pace, "--bus", vendor, "--domain", str(domain),
                                "--duration", "60", "--set", "stop=when_reached"], stderr=subprocess.PIPE, text=True)
        try:
            done = subprocess.run([self.planner, str(domain), "1", "1", *GOAL], capture_output=True, text=True, timeout=100)
            _, err = arm.communicate(timeout=60)
        finally:
            arm.kill()
            arm.wait()
        self.assertEqual(arm.returncode, 0, err)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_in_real_time_over_both_vendors(self):
        for i, vendor in enumerate(("cyclonedds", "fastdds")):
            with self.subTest(vendor):
                self.drives(vendor, "--realtime", 90 + i)

    def test_in_lockstep(self):
        self.drives("cyclonedds", "--lockstep", 92)


if __name__ == "__main__":
    main()
