#!/usr/bin/env python3
"""Bad input: a clear sentence that names file, field and rule, exit code 2, no trace."""

import os
import pathlib
import tempfile
import unittest

from programs import ROOT, hamel, main, scene


class BadInput(unittest.TestCase):
    def refused(self, *args, says):
        code, out, err = hamel(*args)
        self.assertEqual(code, 2, err)
        self.assertEqual(out, "")
        for text in says:
            self.assertIn(text, err)
        self.assertNotIn("terminate", err)
        self.assertNotIn("what():", err)
        self.assertLess(len(err.splitlines()), 30)

    def scene_with(self, text):
        f = tempfile.NamedTemporaryFile("w", suffix=".textproto", dir=ROOT / "deploy/scenes", delete=False)
        self.addCleanup(os.unlink, f.name)
        f.write(text)
        f.close()
        return f.name

    def test_a_missing_file_is_named(self):
        self.refused("run", "no/such.textproto", says=["no/such.textproto"])

    def test_an_unknown_field_has_line_and_column(self):
        text = pathlib.Path(scene("three_link_swing")).read_text() + "\nnonsense: 1\n"
        name = self.scene_with(text)
        line = len(text.splitlines())
        self.refused("run", name, says=[f"{name}:{line}:", "nonsense"])

    def test_a_bad_value_has_line_column_and_rule(self):
        text = pathlib.Path(scene("three_link_swing")).read_text() + "\nduration_s: -1\n"
        text = "\n".join(l for l in text.splitlines() if not l.startswith("duration_s: 1")) + "\n"
        name = self.scene_with(text)
        self.refused("run", name, says=[f"{name}:{len(text.splitlines())}:", "-1", "> 0"])

    def test_an_override_is_checked_like_the_file(self):
        self.refused("run", scene("three_link_swing"), "--set", "dynamics.dt_s=-1", says=["dynamics.dt_s", "-1", "> 0"])
        self.refused("run", scene("three_link_swing"), "--set", "dynamics.tear=hamel", says=["tear"])
        self.refused("run", scene("three_link_swing"), "--set", "dynamics.tier=best", says=["best"])

    def test_a_floating_joint_is_named(self):
        urdf = (ROOT / "deploy/robots/fast_rods.urdf").read_text().replace('type="revolute"', 'type="floating"', 1).replace(
            'type="continuous"', 'type="floating"', 1)
        with tempfile.NamedTemporaryFile("w", suffix=".urdf", delete=False) as f:
            f.write(urdf)
        self.addCleanup(os.unlink, f.name)
        self.refused("run", scene("fast_rods"), "--set", f"robot.urdf={f.name}", says=[f.name, "floating"])

    def test_impossible_robots_are_refused_for_the_reason_in_their_name(self):
        data = os.environ.get("HAMEL_DATA")
        if not data:
            self.skipTest("HAMEL_DATA is not set")
        reasons = {"not_positive": "positive definite", "tree_not_open_chain": "tree", "moving_link_without_inertial": "inertia",
                   "zero_inertia": "inertia", "triangle_inequality": "triangle inequality"}
        files = sorted(pathlib.Path(data, "urdf_bad").glob("*.urdf"))
        self.assertTrue(files)
        for f in files:
            with self.subTest(f.name):
                says = [text for name, text in reasons.items() if name in f.name]
                self.assertTrue(says)
                code, _, err = hamel("run", scene("panda_reach"), "--set", f"robot.urdf={f}")
                self.assertEqual(code, 2)
                self.assertIn(says[0], err)
                self.assertIn(f.name, err)

    def test_usage_errors_are_exit_code_two(self):
        for args in ([], ["run"], ["fly"], ["run", scene("fast_rods"), "--lockstep", "--realtime"],
                     ["run", scene("fast_rods"), "--duration", "-3"]):
            code, _, err = hamel(*args)
            self.assertEqual(code, 2, (args, err))
            self.assertTrue(err.strip())

    def test_what_is_no_number_is_named_with_the_rule(self):
        arm = scene("four_link_avoid")
        for verb, option in ((["run", arm], "--duration"), (["trade", arm], "--horizon"), (["explain", arm], "--seconds"),
                             (["topic", "hz"], "--seconds"), (["status"], "--seconds"), (["bench", "planner"], "--dt"),
                             (["bench", "planner"], "--latency"), (["play", "x.mcap"], "--rate"), (["bench", "bus"], "--rate")):
            for wrong in ("abc", "nan", "-1", "1e300"):
                with self.subTest((verb[0], option, wrong)):
                    code, _, err = hamel(*verb, option, wrong)
                    self.assertEqual(code, 2, err)
                    self.assertIn(f"{option}: {wrong} is not a number ", err)
                    self.assertLess(len(err), 200)

    def test_a_run_shorter_than_a_step(self):
        self.refused("run", scene("four_link_avoid"), "--duration", "1e-9",
                     says=["duration_s = 1e-09", "at least one step", "dynamics.dt_s = 0.001"])

    def test_an_interface_that_does_not_exist_or_is_down(self):
        for vendor in ("fastdds", "cyclonedds"):
            for verb in ("run", "up"):
                self.refused(verb, scene("four_link_avoid"), "--bus", vendor, "--interface", "eth77", says=["eth77"])

    def test_a_domain_that_cannot_be(self):
        for vendor in ("fastdds", "cyclonedds"):
            self.refused("run", scene("four_link_avoid"), "--bus", vendor, "--domain", "233", says=["233"])

    def test_an_unknown_vendor_lists_the_known_ones(self):
        self.refused("run", scene("four_link_avoid"), "--bus", "zeromq", says=["zeromq", "fastdds", "cyclonedds", "inproc"])

    def test_help_and_version_are_no_errors(self):
        for args in (["--help"], ["--version"], ["run", "--help"], ["up", "-h"], ["goal", "-h"], ["status", "-h"]):
            code, out, _ = hamel(*args)
            self.assertEqual(code, 0, args)
            self.assertIn("hamel" if args[0] == "--version" else "-", out)


if __name__ == "__main__":
    main()
