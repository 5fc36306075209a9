#!/usr/bin/env python3
"""Both vendors' DDS over a bad cable: arm on one host, planner and perception on another."""

import json
import subprocess
import tempfile
import time
import unittest

from cable import Cable
from programs import BIN, main, outcome, scene

LOSS = 0.01
GYRO = ["--set", "planner.method=gyro"]


class BadCable(unittest.TestCase):
    def drive(self, vendor, domain, topic, options, **faults):
        """Runs a scene over the cable: (the arm's exit code, the last message on the topic as its writer's host hears it)."""
        try:
            cable = Cable(**faults)
        except (OSError, subprocess.CalledProcessError) as e:
            self.skipTest(f"no privilege for network name spaces and TUN devices: {e}")
        common = [scene("four_link_avoid"), *GYRO, "--domain", domain, "--bus", vendor, "--interface", "cable", *options]
        with cable, tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as log:
            a, b = cable.hosts
            echo = [BIN / "hamel", "topic", "echo", topic, "--json", "--domain", domain, "--bus", vendor, "--interface", "cable"]
            listener = (a if topic == "summary" else b).start(*echo, stdout=said, stderr=log)
            others = [b.start(BIN / f"hamel-{s}", *common, stderr=log) for s in ("perception", "planner")]
            arm = a.start(BIN / "hamel-dynamics", *common, stderr=log)
            try:
                code = arm.wait(90)
                time.sleep(0.2)
            finally:
                for p in (arm, *others, listener):
                    p.kill()
                    p.wait(20)
            said.seek(0), log.seek(0)
            lines = [json.loads(line) for line in said.read().splitlines() if line.startswith("{")]
            self.assertTrue(lines, log.read())
            self.assertGreater(cable.lost, 10)
            return code, lines[-1]

    def test_lockstep_takes_its_time_and_the_same_trajectory(self):
        short = ["--lockstep", "--duration", "0.3", "--set", "stop=at_duration"]
        _, here = outcome("run", scene("four_link_avoid"), *GYRO, *short)
        for i, vendor in enumerate(("cyclonedds", "fastdds")):
            with self.subTest(vendor):
                code, there = self.drive(vendor, 113 + i, "summary", short, loss=0.1, doubled=0.1, late_s=0.001)
                self.assertEqual((code, there["steps"], there["trajectory_hash"]), (0, 300, here["trajectory_hash"]))

    def test_in_real_time_the_arm_moves_and_touches_nothing(self):
        """Whether it gets there in time is a matter of who repeats what is lost how soon: services/README.md has figures."""
        for i, vendor in enumerate(("cyclonedds", "fastdds")):
            with self.subTest(vendor):
                code, last = self.drive(vendor, 115 + i, "report", ["--realtime", "--duration", "8", "--set", "stop=when_reached"],
                                        loss=LOSS, late_s=0.002)
                print(f"{vendor}: loss {LOSS:.0%} and 4 ms there and back: reached after {last['time_to_goal_s']:.1f} s (-1: not yet), "
                      f"clearance {last['clearance_min_m']:.4f} m, contacts {last['contacts']}", flush=True)
                self.assertEqual((code, last["contacts"]), (0, 0))
                self.assertGreater(last["path_length_m"], 0.1)


if __name__ == "__main__":
    main()
