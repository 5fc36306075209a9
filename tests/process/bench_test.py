#!/usr/bin/env python3
"""`hamel bench planner` as a user runs it."""

import csv
import pathlib
import tempfile
import unittest

from programs import hamel, main

# Every kind of cell with something random in it; ways out are looked for in some of these scenes.
RUNS = (
    ("--family", "planar_static,panda_moving", "--spheres", 8, "--scenes", 4, "--seed", 5),
    ("--family", "example_5_2", "--scenes", 2, "--duration", 8, "--methods", "gyro,khatib"),
    ("--family", "planar_moving", "--spheres", 8, "--scenes", 4, "--methods", "gyro", "--best-of", 2, "--rate", 30),
)


class BenchPlanner(unittest.TestCase):
    # No column of the CSV is a time that was measured: all of it must be the same.
    def test_writes_the_same_whatever_the_number_of_threads(self):
        for run in RUNS:
            with self.subTest(run), tempfile.TemporaryDirectory() as folder:
                written = []
                for jobs in (1, 2, 5):
                    table = pathlib.Path(folder, f"{jobs}.csv")
                    code, _, err = hamel("bench", "planner", *run, "--jobs", jobs, "--csv", table)
                    self.assertEqual(code, 0, err)
                    written.append(table.read_text())
                self.assertEqual(written[0], written[1])
                self.assertEqual(written[0], written[2])
                rows = list(csv.DictReader(written[0].splitlines()))
                self.assertGreater(len(rows), 3)
                self.assertGreater(len({r["end_s"] for r in rows}), 3)

    # Three scenes show nothing of 98 %: the interval is wide.
    def test_assert_says_what_is_missed(self):
        run = ("bench", "planner", "--family", "planar_static", "--spheres", 1, "--methods", "gyro", "--scenes", 3)
        code, _, err = hamel(*run, "--assert")
        self.assertEqual(code, 1)
        self.assertIn("missed: planar_static 1: reached", err)
        self.assertEqual(hamel(*run)[0], 0)


if __name__ == "__main__":
    main()
