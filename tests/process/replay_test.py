#!/usr/bin/env python3
"""Recorded obstacles on the bus again: byte for byte, at their times, paused and stepped, and through perception."""

import csv
import json
import os
import pathlib
import pty
import signal
import subprocess
import unittest

from programs import BIN, hamel, main, scene
from recordings import DOMAIN, SHORT, VENDORS, Files

DATA = os.environ.get("HAMEL_DATA")
SOAK = os.environ.get("HAMEL_SOAK") == "1"


class Play(Files):
    def played(self, file, bus, *args):
        """The file in which a recorder kept what `hamel play FILE` said, and the latter's stderr."""
        again = self.file("again.mcap")
        recorder = self.recorder(again, *bus)
        code, _, err = hamel("play", file, *bus, *args)
        self.assertEqual(code, 0, err)
        self.assertEqual(recorder.end()[0], 0)
        return again, err

    def test_the_recorded_bytes_go_on_the_wire_again(self):
        file, _ = self.recorded("panda_person", *SHORT)
        sent = self.payloads(file)
        for i, vendor in enumerate(VENDORS):
            with self.subTest(vendor):
                again, err = self.played(file, ["--bus", vendor, "--domain", DOMAIN + i])
                self.assertIn(f"{len(sent)} messages", err)
                self.assertEqual(self.payloads(again), sent)

    def test_part_of_it_faster(self):
        file, _ = self.recorded("panda_person", *SHORT)
        code, _, err = hamel("play", file, "--domain", DOMAIN, "--rate", 20, "--start", 0.1, "--until", 0.3)
        self.assertEqual(code, 0, err)
        self.assertIn(" 7 messages", err)
        self.assertEqual(hamel("play", file, "--domain", DOMAIN, "--topic", "goal")[0], 3)
        self.assertEqual(hamel("play", file, "--topic", "nonsense")[0], 2)
        self.assertEqual(hamel("play", file, "--paused")[0], 2)

    def test_pause_and_single_step(self):
        """Steps first, then to the end: everything goes out once, in order."""
        file, _ = self.recorded("panda_person", *SHORT)
        again = self.file("again.mcap")
        bus = ["--domain", str(DOMAIN)]
        recorder = self.recorder(again, *bus)
        player = subprocess.Popen([BIN / "hamel", "play", file, *bus, "--control", "--paused"], stdin=subprocess.PIPE,
                                  stderr=subprocess.PIPE, text=True)
        self.addCleanup(player.kill)
        times = []
        for _ in range(3):
            player.stdin.write("step\n")
            player.stdin.flush()
            times.append(player.stderr.readline())
        self.assertEqual(times, ["step to 0.000000 s\n", "step to 0.033333 s\n", "step to 0.066667 s\n"])
        player.stdin.write("dance\nresume\npause\nstep\nresume\n")
        player.stdin.flush()
        _, err = player.communicate(timeout=30)
        self.assertEqual(player.returncode, 0, err)
        self.assertIn('"dance" is no command', err)
        self.assertEqual(err.count("paused before"), 1)
        recorder.end()
        self.assertEqual(self.payloads(again), self.payloads(file))

    def test_keys_of_a_terminal(self):
        file, _ = self.recorded("panda_person", *SHORT)
        pid, terminal = pty.fork()
        if pid == 0:
            os.execv(BIN / "hamel", ["hamel", "play", file, "--domain", str(DOMAIN), "--control", "--paused"])
        said = b""

        def until(word):
            nonlocal said
            while word not in said:
                said += os.read(terminal, 1000)

        until(b"space: pause")
        os.write(terminal, b"..")
        until(b"step to 0.033333 s")
        os.write(terminal, b" ")
        until(b"goes on")
        until(b"16 messages")
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), 0)
        os.close(terminal)

    def test_quit_ends_it(self):
        file, _ = self.recorded("panda_person", *SHORT)
        done = subprocess.run([BIN / "hamel", "play", file, "--domain", str(DOMAIN), "--control", "--paused", "--loop"],
                              input="quit\n", capture_output=True, text=True, timeout=30)
        self.assertEqual(done.returncode, 0, done.stderr)


@unittest.skipUnless(DATA, "HAMEL_DATA is not set: no recorded streams")
class Streams(Files):
    """Every set of every stream, with its obstacles, in order, at its time."""

    def check(self, name, rate):
        with (pathlib.Path(DATA) / "streams" / name).open() as file:
            rows = list(csv.DictReader(file))
        expected = {}
        for r in rows:
            expected.setdefault(float(r["t_s"]), []).append((int(r["id"]), float(r["x_m"]), float(r["radius_m"])))
        bus = ["--domain", DOMAIN + 1]
        again = self.file("again.mcap")
        recorder = self.recorder(again, *bus)
        code, _, err = hamel("play", str(pathlib.Path(DATA) / "streams" / name), *bus, "--rate", rate, deadline_s=600)
        self.assertEqual(code, 0, err)
        recorder.end()
        print(f"\n{name} at {rate}x: {err.strip().split(': ')[-1]}", flush=True)
        sets = [m["message"] for m in self.cat(again, "obstacles")]
        self.assertEqual([s["t_s"] for s in sets], sorted(expected))
        self.assertEqual([s["sequence_number"] for s in sets], list(range(len(expected))))
        for s in sets:
            found = [(o["id"], o["position_m"][0], o["dims_m"][0]) for o in s["obstacles"]]
            self.assertEqual(found, sorted(expected[s["t_s"]]))
        fastest = max((sum(v * v for v in o["twist"]) ** 0.5 for s in sets for o in s["obstacles"] if o["velocity_known"]))
        self.assertLessEqual(fastest, 10)

    def test_all_streams(self):
        for name in ("body_climb_01_01.csv", "crowd_zara01.csv", "human_arm_S01.csv"):
            for rate in (20, 1) if SOAK else (20,):
                with self.subTest(name=name, rate=rate):
                    self.check(name, rate)


class FreshPlanner(Files):
    def test_it_gets_the_recorded_bytes_on_the_recordings_clock(self):
        for i, vendor in enumerate(VENDORS):
            with self.subTest(vendor):
                bus = ["--bus", vendor, "--domain", str(DOMAIN + 2 + i)]
                file, again = self.file(f"{vendor}.mcap"), self.file(f"{vendor}_again.mcap")
                code, _, err = hamel("up", scene("panda_person"), *bus, "--record", file, "--duration", 1.5)
                self.assertIn(code, (0, 3), err)
                for into in ("planner", "dynamics"):
                    code, out, err = hamel("replay", file, "--into", into, "--check", "--json")
                    self.assertEqual(code, 0, out + err)
                    self.assertGreater(json.loads(out)["compared"], 500)
                self.replay_into_planner(file, again, bus)

    def replay_into_planner(self, file, again, bus):
        recorder = self.recorder(again, *bus)
        planner = subprocess.Popen([BIN / "hamel-planner", scene("panda_person"), "--realtime", *bus], stderr=subprocess.DEVNULL)
        self.addCleanup(planner.kill)
        topics = [a for t in ("obstacles", "clock", "state", "goal") for a in ("--topic", t)]
        code, _, err = hamel("play", file, *bus, *topics)
        self.assertEqual(code, 0, err)
        planner.send_signal(signal.SIGTERM)
        planner.wait(20)
        recorder.end()
        for topic in ("obstacles", "clock"):
            self.assertEqual(self.payloads(again, topic), self.payloads(file, topic), topic)
        # Its reports are about the recording's times, and name sets that were there at them.
        stamps = {m["message"]["sequence_number"]: m["message"]["t_s"] for m in self.cat(file, "obstacles")}
        reports = [m["message"] for m in self.cat(again, "report") if m["message"]["caused_by"]]
        self.assertGreater(len(reports), 20)
        used = 0
        for r in reports:
            for cause in r["caused_by"]:
                if cause["service"] != 3:
                    continue
                used += 1
                self.assertAlmostEqual(r["obstacle_age_s"], r["t_s"] - stamps[cause["number"]], places=9)
                self.assertLess(r["obstacle_age_s"], 0.5)
        self.assertGreater(used, 20)


class Perception(Files):
    def test_a_recording_is_a_source_by_the_rules_of_a_csv(self):
        """A CSV played into a recording: perception makes of both the same sets."""
        bus = ["--domain", DOMAIN + 4]
        stream = self.file("stream.mcap")
        person = pathlib.Path(scene("panda_person")).parents[1] / "streams/person_arm.csv"
        recorder = self.recorder(stream, *bus)
        code, _, err = hamel("play", person, *bus, "--rate", 20)
        self.assertEqual(code, 0, err)
        recorder.end()
        by_csv, _ = self.recorded("panda_person", *SHORT)
        expected = self.payloads(by_csv)
        by_mcap, _ = self.recorded("panda_person", *SHORT, "--set", f"perception.stream.path={stream}")
        self.assertEqual(self.payloads(by_mcap), expected)
        # The recording is kept in the new one, which replays by itself.
        self.assertIn("stream.mcap", self.info(by_mcap)[1]["attachments"])
        os.remove(stream)
        code, out, err = hamel("replay", by_mcap, "--into", "planner", "--check")
        self.assertEqual(code, 0, out + err)

    def test_it_stands_while_paused_and_goes_on_by_single_steps(self):
        file = self.file()
        bus = ["--domain", str(DOMAIN + 5)]
        args = [scene("panda_person"), "--realtime", *bus]
        recorder = self.recorder(file, *bus)
        sight = subprocess.Popen([BIN / "hamel-perception", *args, "--control", "--paused", "--rate", "2"],
                                 stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(sight.kill)
        arm = [BIN / "hamel-dynamics", *args, "--readers", "1", "--duration"]
        subprocess.run([*arm, "1"], stderr=subprocess.DEVNULL, timeout=30)
        recorder.end()
        stood = [m["message"] for m in self.cat(file, "obstacles")]
        self.assertGreater(len(stood), 10)
        for s in stood:
            for o, first in zip(s["obstacles"], stood[0]["obstacles"]):
                self.assertEqual(o["position_m"], first["position_m"])
                self.assertEqual(o["twist"], [0] * 6)
        # Three steps: the world is where an unpaused one is after three periods.
        recorder = self.recorder(file, *bus)
        sight.stdin.write("step\nstep\nstep\n")
        sight.stdin.flush()
        for _ in range(3):
            sight.stderr.readline()
        subprocess.run([*arm, "1"], stderr=subprocess.DEVNULL, timeout=30)
        _, err = sight.communicate("resume\nquit\n", timeout=30)
        self.assertEqual(sight.returncode, 0, err)
        self.assertIn("goes on at 0.100 s", err)
        recorder.end()
        stepped = self.cat(file, "obstacles")[-1]["message"]
        by_steps = [o["position_m"] for o in stepped["obstacles"]]
        free, _ = self.recorded("panda_person", *SHORT, "--set", "perception.stream.rate=2")
        third = self.cat(free, "obstacles")[3]["message"]
        self.assertEqual(by_steps, [o["position_m"] for o in third["obstacles"]])


if __name__ == "__main__":
    main()
