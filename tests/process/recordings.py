"""What tests of recordings need: a folder, what a file holds, and its messages byte for byte."""

import json
import os
import pathlib
import signal
import subprocess
import tempfile
import unittest

from programs import BIN, hamel, scene

SHORT = ["--duration", "0.5"]
VENDORS = ("cyclonedds", "fastdds")
DOMAIN = int(os.environ.get("HAMEL_TEST_DOMAIN", 50))  # of these tests, and the eight behind it


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

    def cat(self, file, topic, *args):
        """The messages of a topic, as dictionaries."""
        code, out, err = hamel("log", "cat", file, "--topic", topic, "--json", *args)
        self.assertIn(code, (0, 1, 3), err)  # 1: what is there, of a damaged file
        return [json.loads(line) for line in out.splitlines()]

    def recorded(self, name, *args):
        """The file of a short lockstep run."""
        file = self.file()
        code, out, err = hamel("run", scene(name), "--record", file, "--json", *args)
        self.assertIn(code, (0, 3), err)
        return file, json.loads(out)

    def payloads(self, file, topic="obstacles"):
        """The bytes of each message of a topic, through a copy without compression."""
        copy = self.file("copy.mcap")
        hamel("log", "recover", file, "-o", copy, "--compression", "none")
        channel, found = None, []
        for chunk in [c for op, c in records(pathlib.Path(copy).read_bytes()[8:-8]) if op == 6]:
            for op, r in records(chunk[40:]):  # times, size, CRC, no compression, length
                if op == 4 and r[8:].startswith(f"hamel/v1/{topic}".encode()):
                    channel = r[:2]
                if op == 5 and r[:2] == channel:
                    found.append(r[22:])
        self.assertEqual(len(found), len(self.cat(copy, topic)))
        return found

    def recorder(self, file, *args):
        """A running `hamel record` that listens."""
        r = Recorder(file, *args)
        self.addCleanup(r.kill)
        return r


def records(data):
    """(opcode, content) of each record."""
    at = 0
    while at < len(data):
        length = int.from_bytes(data[at + 1: at + 9], "little")
        yield data[at], data[at + 9: at + 9 + length]
        at += 9 + length


class Recorder:
    def __init__(self, file, *args):
        self.process = subprocess.Popen([BIN / "hamel", "record", "-o", file, *map(str, args)], stderr=subprocess.PIPE, text=True)
        self.process.stderr.readline()  # it waits for writers

    def await_writers(self):
        for line in self.process.stderr:
            if line.startswith("recording"):
                return

    def end(self):
        """Ctrl-C: (exit code, what it said)."""
        self.process.send_signal(signal.SIGINT)
        _, err = self.process.communicate(timeout=20)
        return self.process.returncode, err

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stderr.close()
