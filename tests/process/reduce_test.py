#!/usr/bin/env python3
"""`hamel explain`, `hamel batch` and the reductions of a run, as a user meets them."""

import csv
import json
import os
import pathlib
import signal
import subprocess
import tempfile
import time
import unittest

from programs import BIN, ROOT, hamel, main, outcome, scene

GRID = """
scene: "{scene}"
set: "duration_s=1"
vary {{ field: "planner.kobs" values: ["1", "4", "8"] }}
vary {{ field: "perception.obstacles[0].position_m[0]" from: 2.2 to: 2.6 count: 5 }}
"""


class Explain(unittest.TestCase):
    def test_the_json_names_what_was_left_out(self):
        code, out, _ = hamel("explain", scene("four_link_avoid"), "--json", "--seconds", "0.02")
        self.assertEqual(code, 0)
        j = json.loads(out)
        self.assertEqual((j["space"], j["tier"], j["dt_s"], j["fidelity"]), ("SE2", "midpoint", 0.001, "exact"))
        self.assertEqual(j["joints"]["after"], 4)
        self.assertEqual(j["links"], {"before": 6, "after": 5})
        self.assertEqual(j["obstacles"], {"before": 1, "after": 1})
        self.assertEqual(j["bounds"], [])
        self.assertIn("without plane", j["cost_per_step"])
        self.assertGreater(j["cost_per_step"]["full"]["planner_us"], 0)
        self.assertLess(j["measured_error"], 1e-9)
        self.assertTrue(all(r["why"] and r["what"] for r in j["reductions"]))

    def test_links_of_the_file_and_streamed_obstacles_are_counted(self):
        _, out, _ = hamel("explain", scene("panda_person"), "--json", "--seconds", "0.02", "--set", 'locked[0]={joint: "panda_joint3"}')
        j = json.loads(out)
        urdf = (ROOT / "deploy/robots/panda.urdf").read_text()
        self.assertEqual(j["links"], {"before": urdf.count("<link name"), "after": 7})
        self.assertEqual(j["joints"], {"before": urdf.count("<joint name"), "after": 6})
        self.assertEqual(j["obstacles"], {"before": 6, "after": 6})

    def test_full_fidelity_leaves_nothing_out(self):
        _, out, _ = hamel("explain", scene("four_link_avoid"), "--json", "--seconds", "0.02", "--set", "fidelity=full")
        j = json.loads(out)
        self.assertEqual(j["space"], "SE3")
        self.assertEqual([r["name"] for r in j["reductions"] if r["in_force"] and r["name"] not in ("fixed", "terms")], [])

    def test_a_locked_joint_is_gone_and_a_wrong_one_is_refused(self):
        code, o = outcome("run", scene("four_link_avoid"), "--duration", "0.5", "--set", 'locked[0]={joint: "joint2"}')
        self.assertEqual(code, 3)
        self.assertIn("locked", o["reductions"])
        code, _, err = hamel("run", scene("four_link_avoid"), "--set", 'locked[0]={joint: "nose"}')
        self.assertEqual(code, 2)
        self.assertIn("no such joint", err)


class Fastest(unittest.TestCase):
    def test_explain_gives_each_bound_and_what_was_measured(self):
        code, out, _ = hamel("explain", scene("panda_reach"), "--json", "--seconds", "0.02", "--set", "fidelity=fastest",
                             "--set", "reduce.step=off", "--set", "perception.rate_hz=100", "--set", "reduce.requery=on",
                             "--set", "reduce.cycle=on", "--set", "accuracy.obstacle_error_m=0.004")
        self.assertEqual(code, 0)
        j = json.loads(out)
        bounds = {b["name"]: b for b in j["bounds"]}
        self.assertEqual(set(bounds), {"requery", "rate", "cycle"})
        for b in bounds.values():
            self.assertLessEqual(b["measured"], b["bound"] * 1.001, b)
        self.assertGreater(bounds["requery"]["measured"], 0.02 * bounds["requery"]["bound"])
        names = [r["name"] for r in j["reductions"]]
        for name in ("self", "shapes", "merge", "requery", "cycle", "shared"):
            self.assertIn(name, names)

    def test_bounded_reductions_are_forced_one_by_one_and_the_summary_names_them(self):
        _, o = outcome("run", scene("panda_reach"), "--duration", "0.2", "--set", "reduce.requery=on", "--set", "reduce.cycle=on",
                       "--set", "accuracy.obstacle_error_m=0.004")
        self.assertEqual(o["reductions"], "fixed, self, obstacles, requery, cycle")
        _, plain = outcome("run", scene("panda_reach"), "--duration", "0.2")
        _, seldom = outcome("run", scene("panda_reach"), "--duration", "0.2", "--set", "reduce.requery=on")
        self.assertEqual(plain["trajectory_hash"], seldom["trajectory_hash"])

    def test_cycles_that_hurry_are_the_same_in_one_loop_and_over_a_bus(self):
        fast = ["--set", "qd0=[0.5, 0, 0, 0]", "--set", "planner.vmax_mps=0.5", "--set", "duration_s=0.5"]
        seldom = ["--set", "accuracy.obstacle_error_m=0.01", "--set", "reduce.cycle=on"]
        _, o = outcome("run", scene("four_link_avoid"), *fast, *seldom)
        _, fixed = outcome("run", scene("four_link_avoid"), *fast, "--set", "planner.period_steps=10")
        self.assertNotEqual(o["trajectory_hash"], fixed["trajectory_hash"])
        with tempfile.TemporaryDirectory() as folder:
            table, out = pathlib.Path(folder, "one.csv"), pathlib.Path(folder, "out.csv")
            table.write_text("planner.kobs\n4\n")
            self.assertEqual(hamel("batch", table, "--scene", scene("four_link_avoid"), "-o", out, *fast, *seldom)[0], 0)
            self.assertIn(o["trajectory_hash"], out.read_text())

    def test_what_is_asked_for_and_cannot_be_done_is_said(self):
        asked = ("--set", "reduce.locked=on", "--set", "reduce.plane=on", "--set", "reduce.obstacles=on")
        _, o = outcome("run", scene("panda_reach"), "--duration", "0.1", *asked)
        self.assertEqual([line.split(":")[0] for line in o["asked_for_but"]], ["locked", "plane"])
        _, out, _ = hamel("run", scene("panda_reach"), "--duration", "0.1", *asked)
        self.assertRegex(out, r"asked for, but +locked: no joint is locked\n")
        _, out, _ = hamel("explain", scene("panda_reach"), "--seconds", "0.02", *asked)
        self.assertIn("Asked for, but plane: revolute axes are not all parallel", out)
        for asked, said in (("1e-3", []), ("1e-15", ["step: nothing tried keeps to the accuracy"])):
            _, o = outcome("run", scene("three_link_swing"), "--set", "duration_s=10", "--set", "fidelity=fastest",
                           "--set", f"accuracy.joint_error_rad={asked}")
            self.assertEqual(o["asked_for_but"], said)

    def test_costs_are_those_of_what_was_chosen(self):
        code, out, _ = hamel("explain", scene("panda_reach"), "--json", "--seconds", "0.1", "--set", "fidelity=fastest")
        self.assertEqual(code, 0)
        j = json.loads(out)
        cost = j["cost_per_step"]
        self.assertEqual(cost["full"]["dt_s"], 0.001)
        self.assertEqual(cost["reduced"]["dt_s"], j["dt_s"])
        self.assertEqual(cost["without self"]["dt_s"], j["dt_s"])
        self.assertEqual(cost["without step"]["dt_s"], 0.001)
        self.assertNotEqual(j["tier"], "midpoint", "another step was chosen")
        both = [cost[k]["dynamics_us"] + cost[k]["planner_us"] for k in ("reduced", "full")]
        self.assertAlmostEqual(cost["reduced"]["of_full"], both[0] / both[1] * 0.001 / j["dt_s"], 6)

    def test_run_chooses_tier_and_step_and_keeps_to_the_accuracy(self):
        code, out, _ = hamel("explain", scene("three_link_swing"), "--json", "--seconds", "0.02", "--set", "fidelity=fastest",
                             "--set", "duration_s=10", "--set", "accuracy.joint_error_rad=1e-5")
        self.assertEqual(code, 0)
        j = json.loads(out)
        self.assertLessEqual(j["measured_error"], 1e-5)
        self.assertEqual([b["name"] for b in j["bounds"]], ["step"])
        self.assertIsNone(j["cost_per_step"]["full"]["planner_us"], "nothing is steered")
        code, o = outcome("run", scene("three_link_swing"), "--set", "fidelity=fastest", "--set", "duration_s=10",
                          "--set", "accuracy.joint_error_rad=1e-5")
        self.assertEqual(code, 0)
        self.assertIn("step", o["reductions"])


class Batch(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)
        (self.path / "grid.textproto").write_text(GRID.format(scene=scene("four_link_avoid")))

    def tearDown(self):
        self.folder.cleanup()

    def run_batch(self, name, *more):
        out = self.path / name
        code, text, err = hamel("batch", self.path / "grid.textproto", "-o", out, *more)
        self.assertEqual(code, 0, err)
        return out.read_bytes(), text

    def test_the_table_does_not_depend_on_the_workers(self):
        one, text = self.run_batch("one.csv", "-j", "1")
        three, _ = self.run_batch("three.csv", "-j", "3")
        self.assertEqual(one, three)
        self.assertEqual(len(one.splitlines()), 16)
        self.assertIn("15 variations", text)

    def test_a_variation_is_what_run_gives(self):
        rows, _ = self.run_batch("one.csv")
        last = dict(zip(*[line.decode().split(",") for line in (rows.splitlines()[0], rows.splitlines()[-1])]))
        _, o = outcome("run", scene("four_link_avoid"), "--duration", "1", "--set", "planner.kobs=8",
                       "--set", "perception.obstacles[0].position_m[0]=2.6")
        self.assertEqual(last["trajectory_hash"], o["trajectory_hash"])

    def test_each_variation_has_the_step_that_run_chooses_for_it(self):
        fast = self.path / "fast.csv"
        fast.write_text("fidelity,qd0\nexact,\"[0, 0, 0]\"\nfastest,\"[0, 0, 0]\"\nfastest,\"[20, -30, 40]\"\n")
        out = self.path / "fast_table.csv"
        code, _, err = hamel("batch", fast, "--scene", scene("three_link_swing"), "--set", "duration_s=10", "-o", out)
        self.assertEqual(code, 0, err)
        hashes = [row["trajectory_hash"] for row in csv.DictReader(out.read_text().splitlines())]
        runs = [outcome("run", scene("three_link_swing"), "--set", "duration_s=10", "--set", f"fidelity={f}",
                        "--set", f"qd0={v}")[1]["trajectory_hash"]
                for f, v in (("exact", "[0, 0, 0]"), ("fastest", "[0, 0, 0]"), ("fastest", "[20, -30, 40]"))]
        self.assertEqual(hashes, runs)
        self.assertEqual(len(set(runs)), 3)

    def test_killed_it_goes_on_to_the_same_table(self):
        whole, _ = self.run_batch("whole.csv")
        out = self.path / "cut.csv"
        command = [BIN / "hamel", "batch", self.path / "grid.textproto", "-o", out, "-j", "1"]
        p = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        partial = pathlib.Path(str(out) + ".partial")
        end = time.monotonic() + 60
        while time.monotonic() < end and not (partial.exists() and partial.read_bytes().count(b"\n") >= 4):
            time.sleep(0.001)
        os.kill(p.pid, signal.SIGKILL)
        p.wait()
        if partial.exists():  # else it was done before the kill
            with open(partial, "ab") as f:
                f.write(b"9,cut in the mid")
            code, _, err = hamel("batch", self.path / "grid.textproto", "-o", out)
            self.assertEqual(code, 0)
            self.assertIn("going on after", err)
        self.assertEqual(out.read_bytes(), whole)

    def test_altered_rows_are_done_again(self):
        whole, _ = self.run_batch("whole.csv")
        command = [BIN / "hamel", "batch", self.path / "grid.textproto", "-o", self.path / "cut.csv", "-j", "1"]
        partial = self.path / "cut.csv.partial"

        def kill_in_the_middle():
            p = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            end = time.monotonic() + 60
            while time.monotonic() < end and not (partial.exists() and partial.read_bytes().count(b"\n") >= 6):
                time.sleep(0.001)
            os.kill(p.pid, signal.SIGKILL)
            p.wait()
            return partial.read_bytes().splitlines(keepends=True) if partial.exists() else None

        def altered(lines):  # a figure, a row left out, two that change places, a sum
            yield lines[:3] + [lines[3].replace(b".", b".1", 1)] + lines[4:]
            yield lines[:3] + lines[4:]
            yield lines[:3] + [lines[4], lines[3]] + lines[5:]
            yield lines[:3] + [lines[3][:-2] + (b"0\n" if lines[3][-2:-1] != b"0" else b"1\n")] + lines[4:]

        lines = kill_in_the_middle()
        if not lines:
            return  # it was done before the kill
        for k, text in enumerate(altered(lines)):
            partial.write_bytes(b"".join(text))
            code, _, err = hamel(*command[1:])
            self.assertEqual(code, 0, err)
            self.assertIn("going on after 1 of 15", err)
            self.assertIn("done again", err)
            self.assertEqual((self.path / "cut.csv").read_bytes(), whole, k)

    def test_nothing_that_is_read_or_of_another_batch_is_written_over(self):
        grid = self.path / "grid.textproto"
        code, _, err = hamel("batch", grid, "-o", grid)
        self.assertEqual(code, 2, err)
        self.assertIn("which is read", err)
        os.mkfifo(self.path / "pipe")
        code, _, err = hamel("batch", grid, "-o", self.path / "pipe")
        self.assertEqual(code, 2, err)
        self.assertIn("no ordinary file", err)
        (self.path / "o.csv.partial").write_text("# hamel batch of something else\nvariation\n0\n")
        code, _, err = hamel("batch", grid, "-o", self.path / "o.csv")
        self.assertEqual(code, 2, err)
        self.assertIn("something else", err)
        self.assertTrue((self.path / "o.csv.partial").read_text().endswith("0\n"))
        code, _, err = hamel("batch", grid, "--set", "planner.kobs=3")
        self.assertEqual(code, 2, err)
        self.assertIn("varies", err)

    def test_random_variations_and_tables_are_read(self):
        (self.path / "random.textproto").write_text(
            f'scene: "{scene("four_link_avoid")}" random: 4 seed: 7 set: "duration_s=0.2"\n'
            'vary { field: "planner.kobs" from: 1 to: 8 }\nvary { field: "planner.method" values: ["gyro", "khatib"] }\n')
        code, text, _ = hamel("batch", self.path / "random.textproto")
        self.assertEqual((code, "4 variations" in text), (0, True))
        (self.path / "rows.csv").write_text("planner.kobs,q0\n1,[0, 0.1, 0, 0]\n2,[0, 0, 0, 0]\n")
        code, text, err = hamel("batch", self.path / "rows.csv", "--scene", scene("four_link_avoid"), "--set", "duration_s=0.2")
        self.assertEqual(code, 0, err)
        self.assertIn("2 variations", text)

    def test_a_variation_that_is_no_scene_is_named(self):
        (self.path / "bad.csv").write_text("planner.kobs\n1\n-1\n")
        code, _, err = hamel("batch", self.path / "bad.csv", "--scene", scene("four_link_avoid"), "--set", "duration_s=0.1")
        self.assertEqual(code, 2)
        self.assertIn("variation 1", err)


if __name__ == "__main__":
    main()
