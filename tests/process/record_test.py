#!/usr/bin/env python3
"""Recordings as a user makes them: kept, looked into, replayed to the last bit, mended."""

import json
import pathlib
import signal
import subprocess
import tempfile
import time
import unittest

from programs import BIN, Up, hamel, main, outcome, scene

SHORT = ["--duration", "0.5"]


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def file(self, name="run.mcap"):
        return str(self.folder / name)

    def info(self, file):
        code, out, err = hamel("log", "info", file, "--json")
        self.assertTrue(out, err)
        return code, json.loads(out)

    def recorded(self, name, *args):
        """The file of a short lockstep run."""
        file = self.file()
        code, out, err = hamel("run", scene(name), "--record", file, "--json", *args)
        self.assertIn(code, (0, 3), err)
        return file, json.loads(out)


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

    def test_a_killed_recorder_leaves_all_but_the_last_second(self):
        file = self.file()
        p = subprocess.Popen([BIN / "hamel", "run", scene("four_link_avoid"), "--realtime", "--set", "stop=at_duration",
                              "--record", file, "--json"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(3)
        p.send_signal(signal.SIGKILL)
        p.wait()
        _, info = self.info(file)
        self.assertFalse(info["complete"])
        self.assertGreater(info["end_s"], 1.0)


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

    def test_three_processes_in_real_time_over_each_vendor(self):
        for i, vendor in enumerate(("cyclonedds", "fastdds")):
            with self.subTest(vendor):
                file = self.file()
                code, _, err = hamel("up", scene("panda_person"), "--bus", vendor, "--domain", 60 + i, "--record", file,
                                     "--duration", 1.5)
                self.assertIn(code, (0, 3), err)
                for into in ("planner", "dynamics"):
                    code, r = self.check(file, into)
                    self.assertEqual(code, 0, r)
                    self.assertGreater(r["compared"], 500)


class Record(Files):
    def test_it_says_when_it_records_and_closes_the_file_on_ctrl_c(self):
        file = self.file()
        with Up(scene("four_link_avoid"), "--domain", 62, "--set", "stop=at_duration") as up:
            up.child("dynamics")
            p = subprocess.Popen([BIN / "hamel", "record", "-o", file, "--domain", "62"], stderr=subprocess.PIPE, text=True)
            for line in p.stderr:
                if line.startswith("recording"):
                    break
            time.sleep(1)
            p.send_signal(signal.SIGINT)
            _, err = p.communicate(timeout=20)
            self.assertEqual(p.returncode, 0, err)
        code, info = self.info(file)
        self.assertEqual((code, info["complete"]), (0, True))
        self.assertGreater(info["topics"]["hamel/v1/state"], 300)
        self.assertGreaterEqual(info["topics"]["hamel/v1/robot"], 1)

    def test_nobody_there_is_exit_code_three(self):
        self.assertEqual(hamel("record", "-o", self.file(), "--domain", 63, "--duration", 0.5)[0], 3)


class Play(Files):
    def test_the_recorded_bytes_go_on_the_wire_again_at_their_times(self):
        file, _ = self.recorded("panda_person", *SHORT)
        sent = self.payloads(file)
        for i, vendor in enumerate(("cyclonedds", "fastdds")):
            with self.subTest(vendor):
                again = self.file(f"{vendor}.mcap")
                bus = ["--bus", vendor, "--domain", str(64 + i)]
                p = subprocess.Popen([BIN / "hamel", "record", "-o", again, *bus], stderr=subprocess.PIPE, text=True)
                p.stderr.readline()  # it waits for writers
                code, _, err = hamel("play", file, *bus)
                self.assertEqual(code, 0, err)
                self.assertIn(f"{len(sent)} messages", err)
                p.send_signal(signal.SIGINT)
                p.communicate(timeout=20)
                self.assertEqual(p.returncode, 0)
                self.assertEqual(self.payloads(again), sent)

    def payloads(self, file):
        """The obstacle sets of a recording, as the log shows them and byte for byte through a copy without compression."""
        copy = self.file("copy.mcap")
        hamel("log", "recover", file, "-o", copy, "--compression", "none")
        data, found = pathlib.Path(copy).read_bytes(), []
        _, out, _ = hamel("log", "cat", copy, "--topic", "obstacles", "--json")
        channel = self.channel(data)
        at = 0
        while (at := data.find(b"\x05", at)) >= 0:  # message records: opcode, length, channel, sequence, two times
            length = int.from_bytes(data[at + 1: at + 9], "little")
            same_times = data[at + 15: at + 23] == data[at + 23: at + 31]
            if 22 < length < 1 << 20 and data[at + 9: at + 11] == channel and same_times:
                found.append(data[at + 31: at + 9 + length])
            at += 1
        self.assertEqual(len(found), len(out.splitlines()))
        return found

    @staticmethod
    def channel(data):
        at = data.find(len("hamel/v1/obstacles").to_bytes(4, "little") + b"hamel/v1/obstacles")
        return data[at - 4: at - 2]

    def test_part_of_it_faster(self):
        file, _ = self.recorded("panda_person", *SHORT)
        began = time.monotonic()
        code, _, err = hamel("play", file, "--domain", 66, "--rate", 20, "--start", 0.1, "--until", 0.3)
        self.assertEqual(code, 0, err)
        self.assertIn(" 7 messages", err)
        self.assertLess(time.monotonic() - began, 30)
        self.assertEqual(hamel("play", file, "--domain", 66, "--topic", "goal")[0], 3)
        self.assertEqual(hamel("play", file, "--topic", "nonsense")[0], 2)


if __name__ == "__main__":
    main()
