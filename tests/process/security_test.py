#!/usr/bin/env python3
"""DDS Security: with the identities of deploy/security/make the arm moves; without one, or with another's, nobody is heard."""

import json
import pathlib
import subprocess
import tempfile
import unittest

from programs import BIN, ROOT, hamel, main, scene


class Security(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.keys, cls.strange = pathlib.Path(cls.folder.name) / "keys", pathlib.Path(cls.folder.name) / "strange"
        for keys in (cls.keys, cls.strange):
            subprocess.run([ROOT / "deploy/security/make", keys], check=True, capture_output=True, timeout=60)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def keeps_strangers_out(self, vendor, domain):
        asked = ["--bus", vendor, "--domain", str(domain)]
        services = [subprocess.Popen([BIN / f"hamel-{s}", scene("four_link_avoid"), "--set", "planner.method=gyro", *asked,
                                      "--security", self.keys / s], stderr=subprocess.DEVNULL)
                    for s in ("perception", "planner", "dynamics")]
        try:
            mine = ["--security", self.keys / "client"]
            code, out, err = 3, "", ""
            for _ in range(20):
                if code == 0 and all(s in out for s in ("dynamics", "planner", "perception")):
                    break
                code, out, err = hamel("status", *asked, *mine)
            self.assertIn("dynamics", out, err)
            self.assertIn("planner", out, err)
            self.assertEqual(hamel("hold", *asked, *mine)[0], 0, "a client may")
            self.assertEqual(hamel("resume", *asked, *mine)[0], 0)
            for who in ([], ["--security", self.strange / "client"]):
                code, out, err = hamel("topic", "echo", "state", "--count", 1, *asked, *who)
                self.assertEqual(code, 3, (who, "reads the state", out))
                code, out, err = hamel("stop", *asked, *who)
                self.assertEqual(code, 3, (who, "stops the arm", out))
            code, out, err = hamel("stop", *asked, "--security", self.keys / "perception")
            self.assertNotEqual(code, 0, "perception may not")
            code, out, err = hamel("topic", "echo", "state", "--count", 1, "--json", *asked, *mine)
            self.assertIn('"validity":0', out, "nobody stopped it: " + err)
        finally:
            for s in services:
                s.terminate()
            for s in services:
                s.wait(20)

    def test_hamel_up_gives_each_service_its_own(self):
        code, out, err = hamel("up", scene("four_link_avoid"), "--lockstep", "--duration", 0.2, "--set", "stop=at_duration",
                               "--domain", 97, "--security", self.keys, "--json")
        self.assertEqual(code, 3, err)  # not reached in so short a time
        self.assertEqual(json.loads(out)["steps"], 200, err)

    def test_fastdds(self):
        self.keeps_strangers_out("fastdds", 94)

    def test_cyclonedds(self):
        self.keeps_strangers_out("cyclonedds", 95)

    def test_a_folder_without_keys_is_named(self):
        code, _, err = hamel("status", "--security", self.folder.name, "--domain", 96)
        self.assertEqual(code, 2)
        self.assertIn("ca.pem", err)


if __name__ == "__main__":
    main()
