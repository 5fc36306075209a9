#!/usr/bin/env python3
"""A stranger floods the domain as fast as it can, with valid, broken and many-key messages: the run goes on, what it
missed is counted, and its memory stays."""

import os
import subprocess
import time
import unittest

from programs import Up, main, scene

FLOODER = os.environ["HAMEL_FLOODER"]
DURATION_S = 9
DT_S = 1e-3
GROWTH_kB = 100 * 1024  # of a reader: 64 keys of each topic, 256 states or commands of each at 4 kB at most


def resident_kB(pid):
    with open(f"/proc/{pid}/status") as f:
        return next(int(line.split()[1]) for line in f if line.startswith("VmRSS"))


class Flood(unittest.TestCase):
    def flooded(self, vendor, domain):
        with Up(scene("four_link_avoid"), "--set", "planner.method=gyro", "--set", "stop=at_duration", "--bus", vendor,
                "--domain", domain, "--duration", DURATION_S) as up:
            pids = [up.child(s) for s in ("dynamics", "planner")]
            time.sleep(1)  # the arm moves
            before = [resident_kB(pid) for pid in pids]
            sent = 0
            for stranger in ("fastdds", "cyclonedds"):
                for kind in ("valid", "broken", "keys"):
                    done = subprocess.run([FLOODER, stranger, str(domain), kind, "0.7"], capture_output=True, text=True, timeout=60)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    sent += int(done.stdout)
            growth = [resident_kB(pid) - b for pid, b in zip(pids, before)]
            code, o, err = up.end()
        self.assertGreater(sent, 10000, "a flood")
        self.assertIsNotNone(o, err)
        self.assertIn(o["outcome"], ("REACHED", "MOVING"), (o, err))
        self.assertEqual((o["contacts"], o["restarts"]), (0, 0), (o, err))
        self.assertLess(max(growth), GROWTH_kB, (growth, sent))
        steps, missed = o["steps"], o["deadlines_missed"]
        self.assertEqual(steps, round(DURATION_S / DT_S), "to its end")
        self.assertGreaterEqual((steps + missed) * DT_S, o["wall_s"] - 2, (o, "every step not taken in time is counted"))
        longest_s = max([x["length_s"] for x in o["outages"]], default=0)
        self.assertLessEqual(longest_s, missed * DT_S + 0.5, (o["outages"], missed))
        print(f"{vendor}: {sent} sent, growth {growth} kB, {missed} deadlines missed, outages {o['outages']}, wall {o['wall_s']:.2f}")

    def test_fastdds(self):
        self.flooded("fastdds", 220)

    def test_cyclonedds(self):
        self.flooded("cyclonedds", 221)


if __name__ == "__main__":
    main()
