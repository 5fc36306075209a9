#!/usr/bin/env python3
"""doctor, topic, several arms, real time on request, the word to systemd."""

import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

from programs import BIN, ROOT, Up, hamel, main, scene

VENDORS = ("fastdds", "cyclonedds")


class Doctor(unittest.TestCase):
    def test_says_what_it_looked_at_and_names_an_interface_that_is_not_there(self):
        code, out, err = hamel("doctor", "--json", "--domain", 83)
        findings = {f["what"]: f for f in json.loads(out)["findings"]}
        for what in ("version", "interface lo", "fastdds on domain 83", "cyclonedds on domain 83", "domain 83", "clock", "--priority"):
            self.assertIn(what, findings)
        for vendor in VENDORS:
            self.assertRegex(findings[f"{vendor} version"]["text"], r"^\d+\.\d+\.\d+$")
        self.assertEqual(code, 0, out)
        code, out, err = hamel("doctor", "--interface", "nosuch0", "--domain", 83)
        self.assertEqual(code, 1, out)
        self.assertIn("WRONG", out)
        self.assertIn("nosuch0", out)


class Multicast(unittest.TestCase):
    """What doctor finds out by a datagram of its own, in a network name space with one cable and no route but to its neighbours."""

    def on_the_cable(self, *changes):
        """The two findings about the cable's end: verdict and text, None where there is no such finding."""
        steps = ["ip link set lo up", "ip link add here type veth peer name there", "ip addr add 10.99.1.1/24 dev here",
                 "ip link set here up", "ip link set there up"]
        inside = ["unshare", "-rn", "bash", "-ec"]
        if subprocess.run([*inside, "; ".join(steps)], capture_output=True).returncode:
            self.skipTest("no privilege for a network name space with a cable (veth)")
        done = subprocess.run([*inside, "; ".join([*steps, *changes, f"'{BIN}/hamel' doctor --json --domain 83"])], capture_output=True,
                              text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        findings = {f["what"]: f for f in json.loads(done.stdout)["findings"]}
        return [(f["verdict"], f["text"]) if (f := findings.get(what)) else None for what in ("interface here", "multicast on here")]

    def test_comes_back_where_the_interface_has_it(self):
        self.assertEqual(self.on_the_cable(), [("ok", "multicast discovery"), ("ok", "tried: a datagram came back")])

    def test_needs_no_route(self):
        self.assertEqual(self.on_the_cable("ip route add unreachable 239.255.0.0/16")[1], ("ok", "tried: a datagram came back"))

    def test_is_not_tried_where_the_interface_has_none(self):
        self.assertEqual(self.on_the_cable("ip link set here multicast off"), [("ok", "no multicast: give every host as --peer"), None])

    def test_that_does_not_come_back_is_noted(self):
        self.assertEqual(self.on_the_cable("echo 0 > /proc/sys/net/ipv4/igmp_max_memberships")[1],
                         ("note", "tried: nothing came back within a second"))

    def test_is_not_tried_without_a_cable(self):
        self.assertEqual(self.on_the_cable("ip link set there down"),
                         [("note", "is up, but nothing is at the other end of its cable"), None])


class Topic(unittest.TestCase):
    def test_nobody_there_is_exit_code_three(self):
        for verb in (["list"], ["echo", "state", "--seconds", 1], ["hz", "--seconds", 1], ["latency", "--seconds", 1]):
            code, _, err = hamel("topic", *verb, "--domain", 84)
            self.assertEqual(code, 3, (verb, err))
            self.assertIn("84", err)
        self.assertEqual(hamel("topic", "echo", "nosuch", "--domain", 84)[0], 2)

    def test_every_vendor_sees_the_topics_of_the_other(self):
        for i, (there, here) in enumerate((VENDORS, VENDORS[::-1])):
            with self.subTest(there), Up(scene("four_link_avoid"), "--bus", there, "--domain", 85 + i, "--duration", 25) as up:
                up.child("dynamics")
                asked = ["--bus", here, "--domain", 85 + i]
                code, out, err = hamel("topic", "list", *asked)
                self.assertEqual(code, 0, err)
                for word in ("hamel/v1/state  hamel::v1::ArmState", "writes hamel-dynamics", "reads  hamel-planner"):
                    self.assertIn(word, out)
                code, out, err = hamel("topic", "echo", "state", "--count", 2, "--json", *asked)
                self.assertEqual(code, 0, err)
                first, second = map(json.loads, out.splitlines())
                self.assertEqual(first["arm"], 1)
                self.assertGreater(second["step"], first["step"])
                code, out, err = hamel("topic", "hz", "--json", *asked)
                self.assertEqual(code, 0, err)
                rates = {t["topic"]: t for t in json.loads(out)["topics"]}
                self.assertGreater(rates["state"]["messages"], 100)
                self.assertEqual(rates["state"]["broken"], 0)
                code, out, err = hamel("topic", "latency", "--json", *asked)
                self.assertEqual(code, 0, err)
                self.assertGreater(json.loads(out)["answers"], 100)


    def test_an_echo_to_a_full_disk_ends(self):
        with Up(scene("four_link_avoid"), "--set", "stop=at_duration", "--duration", "40", "--domain", "98") as up:
            up.child("dynamics")
            with open("/dev/full", "w") as full:
                done = subprocess.run([BIN / "hamel", "topic", "echo", "state", "--domain", "98", "--seconds", "20"], stdout=full,
                                      stderr=subprocess.PIPE, text=True, timeout=60)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("standard output", done.stderr)


class Arms(unittest.TestCase):
    def test_two_arms_in_one_process_each_go_to_their_own_goal(self):
        with tempfile.TemporaryDirectory() as folder:
            text = pathlib.Path(scene("four_link_avoid")).read_text()
            text = text.replace("../robots", str(ROOT / "deploy/robots")).replace("gyro_paper", "gyro")
            paths = [pathlib.Path(folder) / f"arm{n}.textproto" for n in (1, 2)]
            for n, path in enumerate(paths, 1):
                path.write_text(text + f"\narm: {n}\n")
            common = [*map(str, paths), "--domain", "87"]
            services = [subprocess.Popen([BIN / f"hamel-{s}", *common]) for s in ("perception", "planner", "dynamics")]
            try:
                code, out, err = hamel("hold", "--arm", 1, "--domain", 87)
                self.assertEqual(code, 0, err)
                before, earlier = self.state(1), 10
                while abs(before - earlier) > 1e-5:  # it comes to rest first
                    before, earlier = self.state(1), before
                code, out, err = hamel("goal", "--arm", 2, "--position", 2, -2, 0, "--domain", 87)
                self.assertEqual(code, 0, err)
                self.assertIn("arm 2", out)
                start = self.state(2)
                end = time.monotonic() + 30
                while time.monotonic() < end and abs(self.state(2) - start) < 0.05:
                    pass
                self.assertGreater(abs(self.state(2) - start), 0.05, "arm 2 goes")
                self.assertLess(abs(self.state(1) - before), 1e-3, "arm 1 does not")
                code, out, err = hamel("status", "--domain", 87)
                for name in ("arm 1 dynamics", "arm 2 dynamics", "arm 1 planner", "arm 2 planner"):
                    self.assertIn(name, out)
            finally:
                for s in services:
                    s.terminate()
                self.assertEqual([s.wait(20) for s in services], [0, 0, 0])

    def state(self, arm):
        code, out, err = hamel("topic", "echo", "state", "--arm", arm, "--count", 1, "--json", "--domain", 87)
        self.assertEqual(code, 0, err)
        return json.loads(out)["position[0]"]

    def test_one_arm_twice_in_one_process_is_refused(self):
        done = subprocess.run([BIN / "hamel-dynamics", scene("four_link_avoid"), scene("panda_reach"), "--domain", "88"],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertIn("arm 1", done.stderr)


class Strangers(unittest.TestCase):
    """A peer that a service cannot work with stands in one line of the service's log and in `hamel status`."""

    def named(self, vendor, domain, kind, *words):
        stranger = subprocess.Popen([os.environ["HAMEL_STRANGER"], vendor, str(domain), kind], stdin=subprocess.PIPE)
        planner = subprocess.Popen([BIN / "hamel-planner", scene("four_link_avoid"), "--bus", vendor, "--domain", str(domain)],
                                   stderr=subprocess.PIPE, text=True)
        try:
            end, out = time.monotonic() + 30, ""
            while time.monotonic() < end and not all(w in out for w in words):
                _, out, _ = hamel("status", "--bus", vendor, "--domain", domain, "--seconds", 1)
            for word in words:
                self.assertIn(word, out)
        finally:
            stranger.communicate()
            planner.terminate()
            log = planner.communicate(timeout=20)[1].splitlines()
        self.assertEqual(sum(all(w in line for w in words) for line in log), 1, log)
        return out

    def test_of_another_type(self):
        for i, vendor in enumerate(("fastdds", "cyclonedds")):
            with self.subTest(vendor):
                self.named(vendor, 60 + i, "type", "hamel/v1/goal", "the writer of stranger", "elsewhere::Goal", "hamel::v1::Goal")

    def test_of_another_qos(self):
        for i, vendor in enumerate(("fastdds", "cyclonedds")):
            with self.subTest(vendor):
                self.named(vendor, 62 + i, "qos", "hamel/v1/status", "durability", "the writer of stranger", "volatile", "transient-local")

    def test_of_another_idl(self):
        for i, vendor in enumerate(("fastdds", "cyclonedds")):
            with self.subTest(vendor):
                out = self.named(vendor, 64 + i, "idl", "planner of arm 9 is 9.9 with IDL of-elsewhere")
                self.assertIn("other IDL: of-elsewhere", out)
                self.assertIn("degraded", out.lower())


class RealTime(unittest.TestCase):
    def test_a_request_is_granted_or_refused_with_its_remedy(self):
        for options, remedy in ((["--priority", "50"], "RTPRIO"), (["--lock-memory"], "MEMLOCK"), (["--cpu", "999"], "taskset")):
            done = subprocess.run([BIN / "hamel-dynamics", scene("three_link_swing"), "--domain", "88", "--duration", "0.05", *options],
                                  capture_output=True, text=True, timeout=60)
            self.assertIn(done.returncode, (0, 2), done.stderr)
            if done.returncode == 2:
                self.assertIn(remedy, done.stderr)
        self.assertEqual(done.returncode, 2, "no machine has a thousand processors here")


class Systemd(unittest.TestCase):
    def test_is_told_ready_alive_and_stopping(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "notify")
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as s:
                s.bind(path)
                s.settimeout(30)
                env = dict(os.environ, NOTIFY_SOCKET=path, WATCHDOG_USEC="200000")
                p = subprocess.Popen([BIN / "hamel-perception", scene("four_link_avoid"), "--domain", "89"], env=env)
                self.assertEqual(s.recv(100), b"READY=1")
                self.assertEqual(s.recv(100), b"WATCHDOG=1")
                self.assertEqual(s.recv(100), b"WATCHDOG=1")
                p.terminate()
                said = {s.recv(100)}
                while b"STOPPING=1" not in said:
                    said.add(s.recv(100))
                self.assertEqual(p.wait(10), 0)


class Deployed(unittest.TestCase):
    """The files of deploy/ that other programs read: as far as those can check them without being started."""

    def test_units_are_ones_that_systemd_understands(self):
        if not shutil.which("systemd-analyze"):
            self.skipTest("systemd-analyze is not installed (systemd)")
        for service in ("dynamics", "planner", "perception"):
            name = f"hamel-{service}@.service"
            unit = (ROOT / "deploy/systemd" / name).read_text()
            self.assertIn(f"ExecStart=/usr/bin/hamel-{service} ", unit)
            for text, good in ((unit, True), (unit.replace("WatchdogSec", "WatchDogSec"), False)):
                with self.subTest(service, good=good), tempfile.TemporaryDirectory() as folder:
                    path = pathlib.Path(folder) / name
                    path.write_text(text.replace("/usr/bin/", f"{BIN}/"))
                    done = subprocess.run(["systemd-analyze", "verify", "--man=no", path], capture_output=True, text=True, timeout=60)
                    self.assertEqual((done.returncode, done.stderr) == (0, ""), good, done.stderr)

    def test_the_compose_file_is_one(self):
        tool = next((t for t in (["docker-compose"], ["docker", "compose"]) if shutil.which(t[0]) and
                     subprocess.run([*t, "version"], capture_output=True).returncode == 0), None)
        if tool is None:
            self.skipTest("docker compose is not installed")
        done = subprocess.run([*tool, "-f", ROOT / "deploy/compose.yaml", "config"], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        for service in ("dynamics", "planner", "perception"):
            self.assertIn(f"hamel-{service}", done.stdout)


class Network(unittest.TestCase):
    def test_two_hosts_on_one_cable(self):
        for options in (["--bus", "cyclonedds"], ["--bus", "fastdds", "--no-multicast"]):
            with self.subTest(options):
                done = subprocess.run([ROOT / "deploy/netns/robots", *options], capture_output=True, text=True, timeout=100,
                                      env=dict(os.environ, HAMEL_BIN=str(BIN)))
                if done.returncode == 77:
                    self.skipTest(done.stderr.strip())
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                self.assertIn("was steered from", done.stdout)

    def test_a_discovery_server_brings_fast_dds_together_and_without_it_nobody_meets(self):
        if not shutil.which("fast-discovery-server"):
            self.skipTest("fast-discovery-server is not installed (fastdds-tools)")
        up = [scene("four_link_avoid"), "--bus", "fastdds", "--discovery-server", "127.0.0.1:11877", "--domain", "97", "--lockstep",
              "--duration", "0.5", "--set", "stop=at_duration"]
        _, here, _ = hamel("run", *up[:1], *up[-5:], "--json")
        server = subprocess.Popen(["fast-discovery-server", "-i", "0", "-l", "127.0.0.1", "-p", "11877"], stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL)
        try:
            _, there, err = hamel("up", *up, "--json")
            self.assertEqual(json.loads(there)["trajectory_hash"], json.loads(here)["trajectory_hash"], err)
        finally:
            server.send_signal(signal.SIGINT)  # killed, it would leave its shared memory behind
            server.wait(20)
        code, _, err = hamel("status", "--bus", "cyclonedds", "--discovery-server", "127.0.0.1:11877", "--domain", 97)
        self.assertEqual(code, 2)
        self.assertIn("Fast DDS", err)


if __name__ == "__main__":
    main()
