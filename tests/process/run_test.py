#!/usr/bin/env python3
"""`hamel run` on the shipped scenes: the figures of the paper and of the acceptance list."""

import csv
import json
import os
import signal
import subprocess
import tempfile
import unittest

from programs import BIN, DEADLINE_S, hamel, main, outcome, scene


class Swing(unittest.TestCase):
    """Example 5.1."""

    def test_the_midpoint_tier_keeps_the_energy(self):
        code, o = outcome("run", scene("three_link_swing"))
        self.assertEqual(code, 0)
        self.assertEqual(o["outcome"], "DONE")
        self.assertEqual((o["method"], o["tier"], o["dt_s"]), (None, "midpoint", 0.01))
        self.assertEqual(o["steps"], 10000)
        self.assertLessEqual(o["energy_drift_rel"], 1e-5)
        self.assertGreater(o["energy_drift_rel"], 1e-7)  # it is second order at dt 0.01, not exact

    def test_the_paper_literally_takes_four_iterations_and_loses_energy(self):
        code, o = outcome("run", scene("three_link_swing"), "--set", "dynamics.tier=hamel", "--set", "dynamics.start=previous",
                          "--set", "dynamics.tolerance_Nm=1e-8", "--set", "dynamics.root=feedback")
        self.assertEqual(code, 0)
        self.assertLessEqual(o["iterations_max"], 4)
        self.assertLess(o["residual_max_Nm"], 1e-8)
        self.assertAlmostEqual(o["energy_drift_rel"], 1.9e-2, delta=2e-3)

    def test_the_last_row_is_the_reference_of_two_solvers(self):
        with tempfile.NamedTemporaryFile(suffix=".csv") as f:
            code, _ = outcome("run", scene("three_link_swing"), "--csv", f.name)
            self.assertEqual(code, 0)
            with open(f.name, newline="") as rows:
                table = list(csv.DictReader(rows))
        self.assertEqual(len(table), 10001)
        last = table[-1]
        self.assertAlmostEqual(float(last["t_s"]), 100.0)
        for name, reference in zip(("q1", "q2", "q3"), (-0.18375788, 0.18144555, -2.70032981)):
            self.assertAlmostEqual(float(last[name]), reference, delta=2e-3)


class Diagnostics(unittest.TestCase):
    def test_the_table_tells_what_the_planner_thought(self):
        with tempfile.NamedTemporaryFile(suffix=".csv") as f:
            code, o = outcome("run", scene("four_link_avoid"), "--set", "planner.method=gyro", "--csv", f.name)
            self.assertEqual(code, 0)
            with open(f.name, newline="") as rows:
                table = list(csv.DictReader(rows))
        self.assertEqual(table[-1]["state"], "REACHED")
        self.assertIn("MOVING", {r["state"] for r in table})
        links = range(1, 5)
        near = [r for r in table if any(float(r[f"gate{i}"]) > 0 for i in links)]
        self.assertTrue(near)
        for r in table[1:]:
            clearance = min(float(r[f"distance_m{i}"]) for i in links)
            self.assertAlmostEqual(clearance, float(r["clearance_m"]), delta=1e-8)
            self.assertLess(abs(float(r["gyroscopic_power_W"])), 1e-9 * (1 + float(r["kinetic_J"])))
            for i in links:  # a force only where the gate is open
                self.assertTrue(float(r[f"gyroscopic_N{i}"]) == 0 or float(r[f"gate{i}"]) > 0)
        self.assertAlmostEqual(min(float(r["clearance_m"]) for r in table), o["min_clearance_m"], delta=1e-6)
        self.assertTrue(any(float(r["barrier_N4"]) > 0 for r in table))
        self.assertTrue(all(float(r["cycle_time_s"]) >= 0 for r in table))


class FourLink(unittest.TestCase):
    """Example 5.2, set s1."""

    def test_the_paper_reaches_past_the_obstacle(self):
        code, o = outcome("run", scene("four_link_avoid"))
        self.assertEqual((code, o["outcome"], o["contacts"]), (0, "REACHED", 0))
        self.assertEqual((o["method"], o["tier"], o["dt_s"]), ("gyro_paper", "midpoint", 0.001))
        self.assertAlmostEqual(o["time_to_goal_s"], 5.5, delta=0.3)
        self.assertAlmostEqual(o["min_clearance_m"], 0.187, delta=0.01)
        self.assertLess(o["final_error_m"], 1e-9)

    def test_khatib_is_stuck_and_says_why(self):
        code, o = outcome("run", scene("four_link_khatib"))
        self.assertEqual((code, o["outcome"], o["reason"]), (1, "STUCK", "local_minimum"))
        self.assertGreater(o["final_error_m"], 1.0)
        self.assertEqual(o["contacts"], 0)

    def test_attraction_alone_hits_the_obstacle_and_is_never_called_reached(self):
        code, o = outcome("run", scene("four_link_avoid"), "--set", "planner.method=attract")
        self.assertEqual((code, o["outcome"], o["reason"]), (1, "UNSAFE", "contact"))
        self.assertGreater(o["contacts"], 0)

    def test_the_default_method_reaches_without_contact(self):
        code, o = outcome("run", scene("four_link_avoid"), "--set", "planner.method=gyro")
        self.assertEqual((code, o["outcome"], o["contacts"]), (0, "REACHED", 0))

    def test_twice_the_same_to_the_last_bit(self):
        hashes = {outcome("run", scene("four_link_avoid"), "--duration", "3")[1]["trajectory_hash"] for _ in range(2)}
        self.assertEqual(len(hashes), 1)
        other = outcome("run", scene("four_link_avoid"), "--duration", "3", "--set", "planner.kobs=4.0000001")[1]
        self.assertNotIn(other["trajectory_hash"], hashes)


class Outputs(unittest.TestCase):
    def test_what_is_read_is_not_written_over(self):
        for verb in ("run", "up"):
            for option in ("--csv", "--record"):
                code, _, err = hamel(verb, scene("four_link_avoid"), option, scene("four_link_avoid"))
                self.assertEqual(code, 2, err)
                self.assertIn("which is read", err)
        for option in ("--csv", "--plot"):
            code, _, err = hamel("bench", "planner", "--scenes", 1, option, "/no/such/folder/x.svg")
            self.assertEqual(code, 2, err)
            self.assertIn("/no/such/folder", err)
        for wrong in (["--dt", "nan"], ["--set", "planner.method=gyro"]):
            code, _, err = hamel("bench", "planner", "--scenes", 1, "--family", "planar_static", *wrong)
            self.assertNotEqual(code, 0, err)

    def test_a_planner_that_overflows_is_unsafe_and_heard(self):
        code, o = outcome("run", scene("four_link_avoid"), "--set", "planner.kp=1e308", "--duration", "0.1")
        self.assertEqual((code, o["outcome"]), (1, "UNSAFE"), o)


class Bench(unittest.TestCase):
    def test_an_interrupted_one_says_so_in_its_figures(self):
        command = [BIN / "hamel", "bench", "planner", "--family", "planar_static", "--methods", "gyro", "--json", "--scenes"]
        done = subprocess.run([*command, "1"], capture_output=True, text=True, timeout=DEADLINE_S)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIs(json.loads(done.stdout)["interrupted"], False)
        endless = subprocess.Popen([*command, "100000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while len(os.listdir(f"/proc/{endless.pid}/task")) < 2:  # until it works
            self.assertIsNone(endless.poll())
        endless.send_signal(signal.SIGINT)
        out, err = endless.communicate(timeout=DEADLINE_S)
        self.assertEqual(endless.returncode, 130, err)
        self.assertIs(json.loads(out)["interrupted"], True)


class Panda(unittest.TestCase):
    def test_reaches_past_three_spheres(self):
        code, o = outcome("run", scene("panda_reach"))
        self.assertEqual((code, o["outcome"], o["contacts"]), (0, "REACHED", 0), o)

    def test_a_person_moving_beside_it_is_not_touched(self):
        code, o = outcome("run", scene("panda_person"))
        self.assertEqual((code, o["outcome"], o["contacts"]), (0, "REACHED", 0), o)


class Output(unittest.TestCase):
    def test_not_in_time_is_exit_code_three(self):
        code, o = outcome("run", scene("four_link_avoid"), "--duration", "1")
        self.assertEqual((code, o["outcome"], o["reason"]), (3, "MOVING", "not_reached_in_time"))

    def test_the_table_says_the_outcome(self):
        code, out, _ = hamel("run", scene("four_link_avoid"), "--duration", "1")
        self.assertEqual(code, 3)
        self.assertIn("MOVING", out)
        self.assertIn("trajectory hash", out)

    def test_a_full_disk_is_said(self):
        code, _, err = hamel("run", scene("three_link_swing"), "--duration", "1", "--csv", "/dev/full")
        self.assertEqual(code, 2)
        self.assertIn("/dev/full", err)


if __name__ == "__main__":
    main()
