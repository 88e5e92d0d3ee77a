#!/usr/bin/env python3
"""Plants violations in a small tree and expects tools/check_layers.py to report each."""
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
import check_layers  # noqa: E402

ARCHITECTURE = """
| folder | what lives in it | may use |
|---|---|---|
| `src/plumb/base` | results | nothing |
| `src/plumb/geometry` | poses | base, Eigen |
| `src/plumb/gpu` | device | base, Vulkan |
| `src/plumb/map` | lines | geometry, JSON |
| `src/plumb/refine` | solvers | geometry, Ceres |
| `runtime` | policy | everything above |
"""

TREE = {
    "docs/architecture.md": ARCHITECTURE,
    "src/plumb/base/result.h": "#include <string>\n",
    "src/plumb/base/CMakeLists.txt": "plumb_add_module(base HEADERS result.h)\n",
    "src/plumb/geometry/pose.h": '#include <Eigen/Core>\n#include "plumb/base/result.h"\n',
    "src/plumb/geometry/CMakeLists.txt":
        "plumb_add_module(geometry HEADERS pose.h PUBLIC plumb::base Eigen3::Eigen)\n",
    "src/plumb/gpu/vulkan_api.h": "#include <volk.h>\n",
    "src/plumb/gpu/device.h": '#include "plumb/base/result.h"\n',
    "src/plumb/gpu/device.cc": '#include "plumb/gpu/device.h"\n#include "plumb/gpu/vulkan_api.h"\n',
    "src/plumb/map/map.h": '#include "plumb/geometry/pose.h"\n#include <Eigen/Core>\n',
    "src/plumb/map/map.cc": '#include "plumb/map/map.h"\n#include <nlohmann/json.hpp>\n',
    "src/plumb/map/CMakeLists.txt":
        "plumb_add_module(map SOURCES map.cc  # comment (with brackets)\n"
        "  PUBLIC plumb::geometry PRIVATE nlohmann_json::nlohmann_json)\n",
    "src/plumb/refine/cost.h": "#include <ceres/cost_function.h>\n",
    "runtime/src/plumb/runtime/session.cc":
        '#include "plumb/map/map.h"\n#include "plumb/refine/cost.h"\n',
    "runtime/CMakeLists.txt": "plumb_add_module(runtime SOURCES s.cc PUBLIC plumb::map)\n",
}


class CheckLayersTest(unittest.TestCase):
    def violations(self, files=None):
        """Those of TREE with `files` added or replaced."""
        with tempfile.TemporaryDirectory() as directory:
            root = pathlib.Path(directory)
            for name, text in {**TREE, **(files or {})}.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text)
            return check_layers.check(root)

    def expect_one(self, files, *words):
        errors = self.violations(files)
        self.assertEqual(len(errors), 1, errors)
        for word in words:
            self.assertIn(word, errors[0])

    def test_accepts_a_tree_without_violation(self):
        self.assertEqual(self.violations(), [])

    def test_refuses_an_include_upwards(self):
        self.expect_one({"src/plumb/geometry/bad.cc": '#include "plumb/map/map.h"\n'},
                        "geometry/bad.cc", "must not use map")

    def test_refuses_an_include_sideways(self):
        self.expect_one({"src/plumb/refine/bad.cc": '  #  include "plumb/map/map.h"\n'},
                        "refine must not use map")

    def test_refuses_an_include_of_the_runtime(self):
        self.expect_one({"runtime/src/plumb/runtime/session.h": "",
                         "src/plumb/map/bad.h": '#include "plumb/runtime/session.h"\n'},
                        "map must not use runtime")

    def test_refuses_a_third_party_that_the_row_does_not_name(self):
        self.expect_one({"src/plumb/map/bad.cc": "#include <ceres/solver.h>\n"},
                        "map must not use Ceres")
        self.expect_one({"src/plumb/base/bad.h": "#include <Eigen/Core>\n"},
                        "base must not use Eigen")

    def test_refuses_a_third_party_through_a_header(self):
        table = ARCHITECTURE.replace("geometry, JSON", "geometry, gpu, JSON")
        self.expect_one({"docs/architecture.md": table,
                         "src/plumb/map/bad.cc": '#include "plumb/gpu/vulkan_api.h"\n'},
                        "map must not use Vulkan", "gpu/vulkan_api.h")
        self.assertEqual(self.violations({
            "docs/architecture.md": table,
            "src/plumb/map/good.cc": '#include "plumb/gpu/device.h"\n'}), [])

    def test_refuses_a_link_that_no_include_shows(self):
        self.expect_one({"src/plumb/geometry/CMakeLists.txt":
                         "plumb_add_module(geometry SOURCES a.cc PUBLIC plumb::map)\n"},
                        "geometry/CMakeLists.txt", "must not link plumb::map")
        self.expect_one({"src/plumb/geometry/CMakeLists.txt":
                         "plumb_add_module(geometry SOURCES a.cc PUBLIC plumb::base\n"
                         "  PRIVATE opencv_core)\n"}, "must not link opencv_core (OpenCV)")

    def test_refuses_folders_and_modules_without_a_row(self):
        self.expect_one({"src/plumb/util/misc.h": "#include <string>\n"}, "util has no row")
        self.expect_one({"src/plumb/base/CMakeLists.txt": "plumb_add_module(util HEADERS a.h)\n"},
                        "module util has no row")

    def test_refuses_files_from_outside(self):
        self.expect_one({"src/plumb/map/bad.cc": '#include "support/random_map.h"\n'},
                        "is no file of src")
        self.expect_one({"src/plumb/map/bad.cc": '#include "map.h"\n'}, "is no file of src")

    def test_refuses_a_row_that_names_nothing_that_exists(self):
        self.expect_one({"docs/architecture.md":
                         ARCHITECTURE.replace("geometry, JSON", "geometry, JSON, magic")},
                        "row map lists magic")

    def test_refuses_to_pass_without_table_or_sources(self):
        self.assertTrue(self.violations({"docs/architecture.md": "nothing here\n"}))
        with tempfile.TemporaryDirectory() as directory:
            (pathlib.Path(directory) / "docs").mkdir()
            (pathlib.Path(directory) / "docs/architecture.md").write_text(ARCHITECTURE)
            self.assertIn("no sources found", check_layers.check(pathlib.Path(directory)))

    def test_ends_where_headers_include_each_other(self):
        self.assertEqual(self.violations({
            "src/plumb/map/a.h": '#include "plumb/map/b.h"\n',
            "src/plumb/map/b.h": '#include "plumb/map/a.h"\n'}), [])


if __name__ == "__main__":
    unittest.main()
