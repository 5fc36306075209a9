#!/usr/bin/env python3
"""`hamel trade` as a user runs it."""

import csv
import pathlib
import signal
import subprocess
import tempfile
import time
import unittest

from programs import BIN, DEADLINE_S, ROOT, hamel, main, scene

SWING = scene("three_link_swing")
ROBOT = ROOT / "deploy/robots/four_link_planar.urdf"


def blocks_interrupts(pid):
    """True once the program takes Ctrl-C itself."""
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(status.split("SigBlk:")[1].split()[0], 16) >> (signal.SIGINT - 1) & 1


class Trade(unittest.TestCase):
    def test_recommends_with_evidence_and_writes_what_it_measured(self):
        with tempfile.TemporaryDirectory() as folder:
            table, picture = pathlib.Path(folder, "t.csv"), pathlib.Path(folder, "t.svg")
            code, out, err = hamel("trade", SWING, "--quick", "--horizon", "10", "--accuracy", "1e-4", "--csv", table, "--plot", picture)
            self.assertEqual(code, 0, err)
            self.assertIn("To keep every joint within 0.0001 over 10 s", out)
            self.assertIn("--set dynamics.tier=", out)
            self.assertEqual(err, "")  # progress is for terminals
            with open(table, newline="") as rows:
                measured = list(csv.DictReader(rows))
            self.assertLessEqual({"midpoint", "gauss", "rk4", "dopri8", "hamel", "semi_implicit_euler"}, {r["tier"] for r in measured})
            self.assertTrue(any(r["front"] == "1" for r in measured))
            self.assertIn("<svg", picture.read_text())

    def test_says_when_nothing_measured_meets_it(self):
        code, out, _ = hamel("trade", SWING, "--quick", "--horizon", "5", "--accuracy", "1e-16")
        self.assertEqual(code, 1)
        self.assertIn("Nothing measured", out)

    def test_without_a_reference_no_joint_error_is_told(self):
        with tempfile.TemporaryDirectory() as folder:
            table, picture = pathlib.Path(folder, "t.csv"), pathlib.Path(folder, "t.svg")
            code, out, err = hamel("trade", scene("fast_rods"), "--quick", "--horizon", "400", "--set", "dynamics.dt_s=0.05",
                                   "--csv", table, "--plot", picture)
            self.assertEqual(code, 0, err)
            self.assertIn("reference: none (valid up to 0 s)", out)
            self.assertIn("keeps energy better", out)
            with open(table, newline="") as rows:
                measured = list(csv.DictReader(rows))
            self.assertEqual({(r["valid_s"], r["joint_error"]) for r in measured}, {("0", "")})
            self.assertTrue(any(r["front"] == "1" for r in measured))
            self.assertNotIn("joint error", picture.read_text())
        code, out, _ = hamel("trade", scene("fast_rods"), "--quick", "--horizon", "400", "--set", "dynamics.dt_s=0.05", "--accuracy", "1")
        self.assertEqual(code, 1)
        self.assertIn("there is no reference", out)

    def test_the_same_twice_but_for_times(self):
        def rows():
            with tempfile.NamedTemporaryFile(suffix=".csv") as f:
                self.assertEqual(hamel("trade", SWING, "--quick", "--horizon", "5", "--by", "evaluations", "--csv", f.name)[0], 0)
                with open(f.name, newline="") as table:
                    return [{k: v for k, v in r.items() if k != "time_s_per_s"} for r in csv.DictReader(table)]
        self.assertEqual(rows(), rows())

    def test_a_plain_robot_will_do(self):
        code, out, err = hamel("trade", ROBOT, "--quick", "--horizon", "0.5", "--set", "dynamics.dt_s=0.002")
        self.assertEqual(code, 0, err)
        self.assertIn("free motion of four_link_planar (4 joints) over 0.5 s", out)
        self.assertIn("gauss-8", out)
        self.assertNotIn("steered", out)

    def test_a_steered_scene_is_told_to_be_measured_without_its_planner(self):
        code, out, err = hamel("trade", scene("four_link_avoid"), "--quick", "--horizon", "0.5")
        self.assertEqual(code, 0, err)
        self.assertIn("no planner", out)

    def test_wrong_files_are_named(self):
        with tempfile.NamedTemporaryFile(suffix=".urdf") as f:
            f.write(b"<robot name='x'><link name='a'/></robot>")
            f.flush()
            for path, word in ((f.name, f.name), ("absent.urdf", "absent.urdf"), ("absent.textproto", "absent.textproto"), ("/", "/")):
                code, out, err = hamel("trade", path)
                self.assertEqual((code, out), (2, ""), path)
                self.assertIn(word, err)
        code, _, err = hamel("trade", ROBOT, "--set", "q0=[1]")
        self.assertEqual(code, 2)
        self.assertIn("q0", err)

    def test_bad_input_is_two(self):
        self.assertEqual(hamel("trade", SWING, "--plot", "x.pdf")[0], 2)
        self.assertEqual(hamel("trade", SWING, "--by", "luck")[0], 2)
        self.assertEqual(hamel("trade", SWING, "--quick", "--horizon", "1", "--csv", "/dev/full")[0], 2)

    def test_ctrl_c_is_130(self):
        p = subprocess.Popen([BIN / "hamel", "trade", SWING, "--horizon", "100000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        with p.stdout, p.stderr:
            end = time.monotonic() + DEADLINE_S
            while not blocks_interrupts(p.pid) and time.monotonic() < end:
                pass
            p.send_signal(signal.SIGINT)
            self.assertEqual(p.wait(DEADLINE_S), 130)


class Figures(unittest.TestCase):
    def test_figures_of_the_paper_are_drawn(self):
        with tempfile.TemporaryDirectory() as folder:
            code, out, err = hamel("figures", SWING, "-o", folder)
            self.assertEqual(code, 0, err)
            self.assertEqual({p.name for p in pathlib.Path(folder).iterdir()},
                             {f"figure{i}.{e}" for i in (3, 4, 5) for e in ("csv", "svg", "png")})
            with open(pathlib.Path(folder, "figure5.csv"), newline="") as rows:
                steps = list(csv.DictReader(rows))
            self.assertEqual(len(steps), 10000)
            self.assertLessEqual(max(int(r["iterations"]) for r in steps), 4)  # as the paper says
            self.assertLess(max(float(r["residual_Nm"]) for r in steps), 1e-8)


    def test_what_shows_no_free_motion_is_refused_before_anything_is_written(self):
        for path, more, word in ((scene("four_link_avoid"), (), "is steered"), (SWING, ("--set", "gravity_mps2=[0, 0, 0]"), "does not move")):
            with tempfile.TemporaryDirectory() as folder:
                out_folder = pathlib.Path(folder, "figures")
                code, out, err = hamel("figures", path, *more, "-o", out_folder)
                self.assertEqual((code, out), (2, ""), path)
                self.assertIn(word, err)
                self.assertNotIn("Warning", err)
                self.assertFalse(out_folder.exists())

    def test_a_motion_that_stays_at_one_height_is_drawn_without_complaint(self):
        with tempfile.TemporaryDirectory() as folder:
            code, _, err = hamel("figures", SWING, "--set", "gravity_mps2=[0, 0, 0]", "--set", "qd0=[0.1, 0, 0]", "--set", "duration_s=2", "-o", folder)
            self.assertEqual((code, err), (0, ""))


if __name__ == "__main__":
    main()
