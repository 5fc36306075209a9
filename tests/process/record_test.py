#!/usr/bin/env python3
"""Recordings as a user makes them: kept, looked into, replayed to the last bit, mended."""

import json
import os
import pathlib
import signal
import subprocess
import time
import unittest

from programs import BIN, Up, hamel, main, outcome, scene
from recordings import DOMAIN, SHORT, Files


class Run(Files):
    def test_every_message_of_a_run_is_kept(self):
        for compression in ("none", "lz4", "zstd"):
            with self.subTest(compression):
                file, o = self.recorded("panda_person", *SHORT, "--compression", compression)
                code, info = self.info(file)
                self.assertEqual(code, 0, info)
                self.assertEqual(info["topics"]["hamel/v1/state"], o["steps"] + 1)
                self.assertEqual(info["topics"]["hamel/v1/command"], o["steps"] + 1)
                self.assertEqual(info["metadata"]["hamel"]["scene"], "panda_person")
                self.assertEqual(set(info["attachments"]), {"hamel_v1.idl", "scene.textproto", "robot.urdf", "stream.csv"})
                self.assertTrue(all("lost 0" in v for v in info["metadata"]["counters"].values()))

    def test_recording_changes_nothing(self):
        _, with_it = self.recorded("four_link_avoid", *SHORT)
        _, without = outcome("run", scene("four_link_avoid"), *SHORT)
        self.assertEqual(with_it["trajectory_hash"], without["trajectory_hash"])

    def test_cat_and_csv_show_it(self):
        file, o = self.recorded("four_link_avoid", *SHORT)
        code, out, _ = hamel("log", "cat", file, "--topic", "command", "--json", "--start", 0.1, "--until", 0.2)
        self.assertEqual(code, 0)
        lines = [json.loads(line) for line in out.splitlines()]
        self.assertEqual([m["message"]["step"] for m in lines], list(range(100, 201)))
        self.assertTrue(all(len(m["message"]["torque"]) == 4 for m in lines))
        code, out, _ = hamel("log", "csv", file, "--topic", "state")
        self.assertEqual(code, 0)
        rows = out.splitlines()
        self.assertTrue(rows[0].startswith("log_time_s,arm,incarnation,step,t_s,dt_s,position[0]"))
        self.assertEqual(len(rows), o["steps"] + 2)

    def test_a_bad_name_is_refused_with_it(self):
        code, _, err = hamel("run", scene("four_link_avoid"), "--record", "/nowhere/x.mcap")
        self.assertEqual(code, 2)
        self.assertIn("/nowhere/x.mcap", err)
        code, _, err = hamel("run", scene("four_link_avoid"), "--record", self.file(), "--compression", "rar")
        self.assertEqual(code, 2)
        self.assertIn("none, lz4 or zstd", err)
        for verb in (["log", "info"], ["log", "cat"], ["replay", "--into", "planner"]):
            code, _, err = hamel(*verb, __file__)
            self.assertEqual(code, 2, verb)
            self.assertIn("is no MCAP file", err)

    def test_what_is_asked_for_and_not_there_is_said(self):
        file, _ = self.recorded("three_link_swing", *SHORT)
        for verb in ("cat", "csv"):
            code, out, err = hamel("log", verb, file, "--topic", "command")
            self.assertEqual(code, 3, out)
            self.assertIn("holds no such message", err)
            self.assertEqual(hamel("log", verb, file, "--topic", "nonsense")[0], 2)
            self.assertEqual(hamel("log", verb, self.file("absent"), "--topic", "state")[0], 2)
        code, _, err = hamel("log", "csv", file, "--topic", "state", "-o", "/nowhere/x.csv")
        self.assertEqual(code, 2)
        self.assertIn("/nowhere/x.csv: cannot write: No such file", err)

    def test_a_reader_that_has_enough_is_no_error(self):
        file, _ = self.recorded("four_link_avoid", *SHORT)
        for trap in ("", "trap '' PIPE; "):
            done = subprocess.run(["bash", "-c", f"{trap}{BIN}/hamel log cat {file} | head -1"], capture_output=True, text=True)
            self.assertEqual(done.stderr, "")
            self.assertEqual(len(done.stdout.splitlines()), 1)

    def test_a_table_has_a_column_for_every_field_that_ever_was(self):
        file, _ = self.recorded("panda_person", *SHORT)
        code, out, _ = hamel("log", "csv", file, "--topic", "report")
        self.assertEqual(code, 0)
        rows = [line.count(",") for line in out.splitlines()]
        self.assertEqual(len(set(rows)), 1)
        self.assertIn("links[6].distance_m", out.splitlines()[0])

    def test_collision_spheres_beside_the_robot_are_kept(self):
        robot, there = self.folder / "arm.urdf", self.folder / "scene.textproto"
        robot.write_text((pathlib.Path(scene("x")).parents[1] / "robots/panda.urdf").read_text())
        (self.folder / "arm.spheres.textproto").write_text('link { name: "panda_hand" spheres { center_m: [0, 0, 0.3] radius_m: 0.09 } }')
        there.write_text(pathlib.Path(scene("panda_reach")).read_text().replace("../robots/panda.urdf", "arm.urdf"))
        file = self.file()
        code, _, err = hamel("run", there, "--record", file, *SHORT)
        self.assertIn(code, (0, 1, 3), err)
        self.assertIn("robot.spheres.textproto", self.info(file)[1]["attachments"])
        robot.unlink()
        self.assertEqual(hamel("replay", file, "--into", "planner", "--check")[0], 0)


class Damage(Files):
    def test_a_cut_recording_is_said_read_and_mended(self):
        file, _ = self.recorded("panda_person", *SHORT)
        cut, mended = self.file("cut.mcap"), self.file("mended.mcap")
        whole = pathlib.Path(file).read_bytes()
        pathlib.Path(cut).write_bytes(whole[: len(whole) * 2 // 3])
        code, info = self.info(cut)
        self.assertEqual((code, info["complete"]), (1, False))
        self.assertGreater(info["messages"], 0)
        code, out, err = hamel("log", "recover", cut, "-o", mended)
        self.assertEqual(code, 0, err)
        self.assertIn("the file ends", err)
        code, again = self.info(mended)
        self.assertEqual((code, again["messages"], again["topics"]), (0, info["messages"], info["topics"]))

    def test_a_full_disk_is_said_the_run_goes_on_and_the_file_is_readable(self):
        """A limit of the file's size stands for the disk."""
        file = self.file()
        command = f"ulimit -f 600; trap '' XFSZ; exec {BIN}/hamel run {scene('panda_person')} --record {file} --compression none --json"
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["outcome"], "REACHED")
        self.assertIn(f"{file}: cannot write on", done.stderr)
        code, info = self.info(file)
        self.assertGreater(info["messages"], 100)

    def test_a_really_full_disk(self):
        """A small tmpfs in a mount namespace of our own."""
        folder = self.folder / "disk"
        folder.mkdir()
        script = (f"mount -t tmpfs -o size=400k none {folder} && "
                  f"{BIN}/hamel run {scene('panda_person')} --record {folder}/run.mcap --compression none --json; "
                  f"code=$?; cp {folder}/run.mcap {self.file()}; exit $code")
        if subprocess.run(["unshare", "-rm", "true"], capture_output=True).returncode != 0:
            self.skipTest("no user and mount namespaces here")
        done = subprocess.run(["unshare", "-rm", "bash", "-c", script], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["outcome"], "REACHED")
        self.assertIn("cannot write on: No space left on device; the run goes on", done.stderr)
        _, info = self.info(self.file())
        self.assertGreater(info["messages"], 100)
        self.assertLess(info["end_s"], json.loads(done.stdout)["steps"] * 1e-3)

    def test_a_recorder_killed_at_full_rate_loses_at_most_a_second(self):
        """Another one, ended behind it, knows what there was to keep."""
        killed, whole = self.file("killed.mcap"), self.file("whole.mcap")
        bus = ["--domain", DOMAIN + 6]
        with Up(scene("panda_person"), *bus, "--set", "stop=at_duration") as up:
            up.child("dynamics")
            recorders = [self.recorder(f, *bus) for f in (killed, whole)]
            for r in recorders:
                r.await_writers()
            time.sleep(2)
            recorders[0].kill()
            recorders[1].end()
        end = {f: self.info(f)[1]["end_s"] for f in (killed, whole)}
        self.assertFalse(self.info(killed)[1]["complete"])
        self.assertGreater(end[killed], 0.5)
        self.assertLessEqual(end[whole] - end[killed], 1.0)
        # What is in the file is without a hole, and mended it is whole.
        steps = [m["message"]["step"] for m in self.cat(killed, "state")]
        self.assertEqual(steps, list(range(steps[0], steps[0] + len(steps))))
        mended = self.file("mended.mcap")
        self.assertEqual(hamel("log", "recover", killed, "-o", mended)[0], 0)
        self.assertEqual(self.info(mended)[0], 0)


class Replay(Files):
    def check(self, file, into, *args):
        code, out, err = hamel("replay", file, "--into", into, "--check", "--json", *args)
        self.assertTrue(out, err)
        return code, json.loads(out)

    def test_lockstep_runs_are_the_same_bit_for_bit(self):
        for name in ("panda_person", "four_link_avoid"):
            file, o = self.recorded(name, *SHORT)
            for into, count in (("planner", 2 * (o["steps"] + 1)), ("dynamics", o["steps"] + 1)):
                with self.subTest(name=name, into=into):
                    code, r = self.check(file, into)
                    self.assertEqual((code, r["compared"], r["different"]), (0, count, 0), r)

    def test_a_free_arm_too(self):
        file, o = self.recorded("three_link_swing", "--duration", "5")
        code, r = self.check(file, "dynamics")
        self.assertEqual((code, r["compared"]), (0, o["steps"] + 1), r)
        self.assertEqual(hamel("replay", file, "--into", "planner", "--check")[0], 3)

    def test_one_ulp_is_found_and_named(self):
        file, _ = self.recorded("panda_person", *SHORT)
        code, r = self.check(file, "planner", "--set", "planner.kp=30.000000000000004")
        self.assertEqual(code, 1)
        self.assertEqual(r["first"]["topic"], "hamel/v1/command")
        self.assertTrue(r["first"]["field"].startswith("torque["))
        self.assertNotEqual(r["first"]["recorded"], r["first"]["replayed"])
        code, r = self.check(file, "dynamics", "--set", "gravity_mps2=[0,0,-9.810000000000002]")
        self.assertEqual(code, 1)
        self.assertEqual(r["first"]["topic"], "hamel/v1/state")
        code, r = self.check(file, "dynamics", "--set", "gravity_mps2=[0,0,-9.810000000000002]", "--tolerance", "*=1e-6",
                             "--tolerance", "solver.iterations=3", "--tolerance", "solver.evaluations=5")
        self.assertEqual(code, 0, r)

    def test_a_realtime_run_in_one_process(self):
        file = self.file()
        code, _, err = hamel("run", scene("panda_person"), "--realtime", "--record", file, *SHORT)
        self.assertIn(code, (0, 3), err)
        for into in ("planner", "dynamics"):
            code, r = self.check(file, into)
            self.assertEqual(code, 0, r)
            self.assertGreater(r["compared"], 300)


class Record(Files):
    def test_it_says_when_it_records_and_closes_the_file_on_ctrl_c(self):
        file = self.file()
        with Up(scene("four_link_avoid"), "--domain", DOMAIN + 7, "--set", "stop=at_duration") as up:
            up.child("dynamics")
            recorder = self.recorder(file, "--domain", DOMAIN + 7)
            recorder.await_writers()
            time.sleep(1)
            code, err = recorder.end()
            self.assertEqual(code, 0, err)
        code, info = self.info(file)
        self.assertEqual((code, info["complete"]), (0, True))
        self.assertGreater(info["topics"]["hamel/v1/state"], 300)
        self.assertGreaterEqual(info["topics"]["hamel/v1/robot"], 1)

    @unittest.skipUnless(os.environ.get("HAMEL_SOAK") == "1", "a measurement: with tests/run --soak")
    def test_it_costs_less_than_a_tenth_of_a_core_and_drops_nothing(self):
        done = subprocess.run([os.environ["HAMEL_RECORD_BENCH"], BIN / "hamel", "20"], capture_output=True, text=True, timeout=120)
        print("\n" + done.stdout, flush=True)
        self.assertEqual(done.returncode, 0)

    def test_nobody_there_is_exit_code_three(self):
        self.assertEqual(hamel("record", "-o", self.file(), "--domain", DOMAIN + 8, "--duration", 0.5)[0], 3)


if __name__ == "__main__":
    main()
