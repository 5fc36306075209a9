#!/usr/bin/env python3
"""Who takes a killed service's place, and in what order they come: the arm is driven again, in lockstep to the same trajectory."""

import itertools
import json
import os
import signal
import subprocess
import tempfile
import time
import unittest

from programs import BIN, Up, hamel, main, outcome, scene

SERVICES = ("dynamics", "planner", "perception")
MIXED = ["--set", "dynamics.bus=fastdds", "--set", "planner.bus=cyclonedds", "--set", "perception.bus=fastdds"]


class Successor(unittest.TestCase):
    """A service comes back as somebody else: another vendor's, the same process number, after it ended by itself."""

    def drives(self, domain, before):
        """The arm's step once it obeys a planner that sees, later than `before`."""
        end, state, report = time.monotonic() + 30, None, None
        while time.monotonic() < end:
            echoes = [hamel("topic", "echo", topic, "--count", 1, "--json", "--domain", domain) for topic in ("state", "report")]
            if any(code for code, _, _ in echoes):
                continue  # not up yet, on a busy machine
            state, report = (json.loads(out) for _, out, _ in echoes)
            sees = isinstance(report["obstacle_age_s"], (int, float)) and report["obstacle_age_s"] < 0.3
            if state["validity"] == 0 and sees and min(state["step"], report["step"]) > before + 500:
                return state["step"]
        self.fail(f"the arm is not driven again: {state}, {report}")

    def follows(self, service, domain, *ways):
        """Each way: prefix of the command line and options of the service, one after the other."""
        name, method = scene("four_link_avoid"), ["--set", "planner.method=gyro"]
        with tempfile.TemporaryDirectory() as folder:
            start = lambda service, prefix, options: subprocess.Popen(
                [*prefix, BIN / f"hamel-{service}", name, *method, "--domain", str(domain), *options], stderr=subprocess.DEVNULL)
            others = [start(s, [], []) for s in SERVICES if s != service]
            one = None
            try:
                step = 0
                for prefix, options in ways:
                    one = start(service, prefix, ["--state-dir", folder, *options])
                    step = self.drives(domain, step)
                    one.kill()
                    one.wait(20)
            finally:
                for p in [*others, one]:
                    p.kill()
                    p.wait(20)

    def same_number(self):
        """Prefix of a command line whose process has the number 1, as it sees itself."""
        unshare = ["unshare", "-Urpf", "--kill-child"]
        if subprocess.run([*unshare, "true"], capture_output=True).returncode:
            self.skipTest("no privilege for a name space of process numbers")
        return unshare

    def test_over_another_vendor(self):
        self.follows("planner", 83, ([], ["--bus", "cyclonedds"]), ([], ["--bus", "fastdds"]), ([], ["--bus", "cyclonedds"]))

    def test_with_the_same_process_number(self):
        for i, vendor in enumerate(("cyclonedds", "fastdds")):
            with self.subTest(vendor):
                self.follows("planner", 84 + i, *[(self.same_number(), ["--bus", vendor])] * 2)

    def test_of_dynamics_and_perception_with_the_same_number_and_over_another_vendor(self):
        for i, service in enumerate(("dynamics", "perception")):
            with self.subTest(service):
                one, other = ((self.same_number(), ["--bus", vendor]) for vendor in ("cyclonedds", "fastdds"))
                self.follows(service, 87 + i, one, one, other)

    def test_after_it_ended_by_itself(self):
        with Up(scene("four_link_avoid"), "--set", "planner.method=gyro", "--duration", 25, "--domain", 86) as up:
            first = [up.child(s) for s in ("planner", "perception")]
            up.child("dynamics")
            time.sleep(1)
            for pid in first:
                os.kill(pid, signal.SIGTERM)
            code, o, err = up.end()
        for service in ("planner", "perception"):
            self.assertIn(f"{service} died (exit code 0)", err)
        self.assertEqual((code, o["outcome"]), (0, "REACHED"), err)


class Lockstep(unittest.TestCase):
    LONG = ["--lockstep", "--set", "planner.method=gyro", "--set", "stop=at_duration", "--duration", "60"]

    def test_a_planner_that_is_killed_in_the_middle_changes_nothing(self):
        for i, extra in enumerate(([], ["--bus", "fastdds"], MIXED)):
            with self.subTest(extra):
                _, here = outcome("run", scene("four_link_avoid"), *self.LONG)
                with Up(scene("four_link_avoid"), *self.LONG, "--domain", 90 + i, *extra) as up:
                    up.child("dynamics")
                    for _ in range(3):
                        time.sleep(0.4)
                        os.kill(up.child("planner"), signal.SIGKILL)
                    code, there, err = up.end()
                self.assertEqual(there["trajectory_hash"], here["trajectory_hash"], err)
                self.assertGreaterEqual(there["restarts"], 1, err)

    def test_a_perception_that_is_killed_in_the_middle_of_a_stream_changes_nothing(self):
        long = [scene("panda_person"), "--lockstep", "--set", "stop=at_duration", "--duration", 30]
        _, here = outcome("run", *long)
        with Up(*long, "--domain", 93) as up:
            up.child("dynamics")
            for _ in range(2):
                time.sleep(0.7)
                os.kill(up.child("perception"), signal.SIGKILL)
            code, there, err = up.end()
        self.assertEqual((there["steps"], there["trajectory_hash"]), (30000, here["trajectory_hash"]), err)
        self.assertGreaterEqual(there["restarts"], 1, err)

    def test_who_starts_first_changes_nothing(self):
        short = [scene("four_link_avoid"), "--lockstep", "--duration", "0.3", "--set", "stop=at_duration"]
        _, here = outcome("run", *short)
        runs = []
        for i, order in enumerate(itertools.permutations(SERVICES)):
            domain = ["--domain", str(120 + i)]
            hear = subprocess.Popen([BIN / "hamel", "topic", "echo", "summary", "--json", *domain], stdout=subprocess.PIPE, text=True)
            services = {}
            for service in order:
                services[service] = subprocess.Popen([BIN / f"hamel-{service}", *short, *domain], stderr=subprocess.DEVNULL)
                time.sleep(0.15)
            runs.append((order, services, hear))
        for order, services, hear in runs:
            with self.subTest(order):
                try:
                    self.assertEqual(services["dynamics"].wait(60), 0)
                    for line in hear.stdout:
                        last = json.loads(line)
                        if last["final_summary"]:
                            break
                    self.assertEqual(last["trajectory_hash"], here["trajectory_hash"])
                finally:
                    for p in (*services.values(), hear):
                        p.kill()
                        p.wait(20)
                    hear.stdout.close()

    def test_mixed_vendors_give_the_same_trajectory_both_ways(self):
        short = ["--lockstep", "--duration", "3"]
        _, here = outcome("run", scene("four_link_avoid"), *short)
        for i, (a, b) in enumerate((("fastdds", "cyclonedds"), ("cyclonedds", "fastdds"))):
            with self.subTest(a):
                _, there = outcome("up", scene("four_link_avoid"), *short, "--domain", 76 + i, "--set", f"dynamics.bus={a}",
                                   "--set", f"planner.bus={b}", "--set", f"perception.bus={b}")
                self.assertEqual(there["trajectory_hash"], here["trajectory_hash"])


if __name__ == "__main__":
    main()
