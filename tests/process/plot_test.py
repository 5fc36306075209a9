#!/usr/bin/env python3
"""Pictures of runs: from a recording and from a CSV, of every kind."""

import re
import shutil
import unittest
from xml.etree import ElementTree

from programs import hamel, main, scene
from recordings import SHORT, Files


@unittest.skipUnless(shutil.which("gnuplot"), "gnuplot is not installed")
class Plot(Files):
    def drawn(self, *args, name="out.svg"):
        """The text of the picture."""
        code, _, err = hamel("plot", *args, "-o", self.folder / name)
        self.assertEqual((code, err), (0, ""))
        return (self.folder / name).read_bytes()

    def test_every_kind_from_a_recording(self):
        file, _ = self.recorded("panda_person", *SHORT)
        shows = {"path": ["end effector", "links", "obstacle", "influence", "target", "arm"],
                 "clearance": ["clearance", "distance to target"], "energy": ["energy"], "iterations": ["iterations"],
                 "latencies": ["planner, wall time", "command, age", "obstacles, age"]}
        for kind, words in shows.items():
            picture = self.drawn(file, "--kind", kind).decode()
            for word in words:
                self.assertIn(word, picture, kind)
            self.assertIn("panda_person", picture)
        whole = self.drawn(file, "--kind", "all").decode()
        for words in shows.values():
            self.assertIn(words[0], whole)
        self.assertTrue(self.drawn(file, name="out.png").startswith(b"\x89PNG"))

    def test_a_csv_with_its_scene_and_without(self):
        table = self.folder / "run.csv"
        code, _, err = hamel("run", scene("four_link_avoid"), "--csv", table, *SHORT)
        self.assertEqual(code, 3, err)
        self.assertIn("obstacle", self.drawn(table, "--scene", scene("four_link_avoid")).decode())
        alone = self.drawn(table, "--kind", "all").decode()
        self.assertIn("end effector", alone)
        self.assertNotIn("obstacle", alone)
        code, _, err = hamel("plot", table, "-o", self.folder / "x.svg", "--kind", "latencies")
        self.assertEqual(code, 2)
        self.assertIn("holds no latencies", err)
        code, _, err = hamel("plot", table, "-o", self.folder / "x.svg", "--scene", scene("panda_reach"))
        self.assertEqual(code, 2)
        self.assertIn("has 4 joints", err)
        code, _, err = hamel("plot", table, "-o", self.folder / "x.svg", "--set", "planner.rho0_m=abc")
        self.assertEqual((code, err), (2, "hamel plot: --set planner.rho0_m=abc: changes a scene: name it with --scene\n"))

    def test_a_csv_with_a_word_for_a_number_is_refused(self):
        table = self.folder / "run.csv"
        code, _, err = hamel("run", scene("four_link_avoid"), "--csv", table, *SHORT)
        self.assertEqual(code, 3, err)
        lines = table.read_text().splitlines()
        names, cells = lines[0].split(","), lines[4].split(",")
        for column in ("t_s", "q2", "ee_y_m", "energy_J"):
            spoiled = list(cells)
            spoiled[names.index(column)] = "abc"
            table.write_text("\n".join([*lines[:4], ",".join(spoiled), *lines[5:]]) + "\n")
            code, _, err = hamel("plot", table, "-o", self.folder / "x.svg")
            self.assertEqual((code, err), (2, f"hamel plot: {table}:5: {column} is not a number\n"))

    def test_labels_of_the_axes_do_not_meet(self):
        """Both axes of the path have one scale, and one of them may be short."""
        table = self.folder / "run.csv"
        code, _, err = hamel("run", scene("panda_reach"), "--csv", table)
        self.assertEqual(code, 0, err)
        picture = ElementTree.fromstring(self.drawn(table, "--kind", "path"))
        below = {}
        for g in picture.iter("{http://www.w3.org/2000/svg}g"):
            at = re.match(r"translate\(([-\d.]+),([-\d.]+)\)", g.get("transform", ""))
            text = "".join(g.itertext()).strip()
            if at and re.fullmatch(r"-?[\d.]+", text) and 'middle' in ElementTree.tostring(g, "unicode"):
                below.setdefault(float(at[2]), []).append((float(at[1]), text))
        self.assertTrue(below)
        for labels in below.values():
            labels.sort()
            for (x, text), (other, more) in zip(labels, labels[1:]):
                self.assertGreater(other - x, 3.5 * (len(text) + len(more)), labels)

    def test_a_free_arm_shows_its_energy(self):
        file, _ = self.recorded("three_link_swing", *SHORT)
        self.assertIn("energy", self.drawn(file).decode())

    def test_any_name_of_a_file(self):
        file, _ = self.recorded("four_link_avoid", *SHORT)
        self.drawn(file, name="it's a \"picture\" of $x.svg")
        for bad in ("out.pdf", "line\nbreak.svg"):
            self.assertEqual(hamel("plot", file, "-o", self.folder / bad)[0], 2)
        code, _, err = hamel("plot", file, "-o", "/nowhere/x.svg")
        self.assertEqual(code, 2)
        self.assertIn("/nowhere/x.svg", err)
        self.assertEqual(hamel("plot", __file__, "-o", self.folder / "x.svg")[0], 2)

    def test_a_cut_recording_is_drawn_as_far_as_it_goes(self):
        file, _ = self.recorded("panda_person", *SHORT)
        whole = (self.folder / "run.mcap").read_bytes()
        (self.folder / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
        code, _, err = hamel("plot", self.folder / "cut.mcap", "-o", self.folder / "x.svg")
        self.assertEqual(code, 0)
        self.assertIn("the file ends", err)


if __name__ == "__main__":
    main()
