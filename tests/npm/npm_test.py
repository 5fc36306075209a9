#!/usr/bin/env python3
"""Our recordings, read and decoded by the readers of npm that other people's tools are made of."""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "process"))
from programs import hamel, main, scene  # noqa: E402

SAMPLES = os.environ.get("HAMEL_MCAP_SAMPLES", "")
TYPES = ["ArmState", "Goal", "ModeCommand", "ObstacleSet", "PlannerReport", "RobotDescription", "RunSummary",
         "ServiceStatus", "SimulationClock", "TorqueCommand"]


class Npm(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if not (HERE / "node_modules").is_dir() or shutil.which("node") is None:
            reason = "npm's packages are not installed: run `npm ci` in tests/npm, or tests/run"
            if os.environ.get("HAMEL_DATA"):
                raise AssertionError(reason)  # where the data is there, all is to be tested
            raise unittest.SkipTest(reason)

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def read(self, file):
        code, out, err = hamel("log", "cat", file, "--json")
        self.assertEqual(code, 0, err)
        cat = self.folder / "cat.jsonl"
        cat.write_text(out)
        done = subprocess.run(["node", HERE / "read.cjs", file, cat], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_every_type_is_decoded_to_our_values(self):
        for compression in ("none", "lz4", "zstd"):
            with self.subTest(compression):
                file = self.folder / "samples.mcap"
                subprocess.run([SAMPLES, file, compression], check=True, timeout=60)
                r = self.read(file)
                self.assertEqual(r["types"], [f"hamel::v1::{t}" for t in TYPES])
                self.assertEqual(r["attachments"], ["robot.urdf"])

    def test_a_run_is_read_in_every_compression(self):
        for compression in ("none", "lz4", "zstd"):
            with self.subTest(compression):
                file = self.folder / "run.mcap"
                code, _, err = hamel("run", scene("panda_person"), "--record", file, "--compression", compression,
                                     "--duration", 0.5)
                self.assertIn(code, (0, 3), err)
                r = self.read(file)
                self.assertGreater(r["messages"], 1500)
                self.assertEqual(list(r["chunks"]), ["" if compression == "none" else compression])
                self.assertEqual(r["metadata"], ["counters", "hamel"])

    def test_a_changed_bit_is_found_by_them_too(self):
        file, changed = self.folder / "samples.mcap", self.folder / "changed.mcap"
        subprocess.run([SAMPLES, file, "none"], check=True, timeout=60)
        (self.folder / "cat.jsonl").write_text("")
        data = bytearray(file.read_bytes())
        data[len(data) // 4] ^= 1
        changed.write_bytes(data)
        done = subprocess.run(["node", HERE / "read.cjs", changed, self.folder / "cat.jsonl"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("CRC", done.stderr)


if __name__ == "__main__":
    main()
