"""The package's structure, read from its source: one-way imports, what each layer may know, sizes."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "irtscots_cl"

# Every module of the package, in order: each may import only modules before it.
MATHEMATICS = ("geometry", "zernikes", "zonal", "integration")
DESCRIPTION = ("memory", "checked", "scatter", "element", "scene", "presets", "surface", "calibration", "pixelmap",
               "cells", "pixellight")  # fmt: skip
DEVICE = ("interface", "device", "program", "selftest", "execution")
TRACING = ("windows", "samplers", "options", "launches", "checkpoint", "runner", "crew", "tasks", "cluster", "aiming",
           "packing", "transport", "analytic", "parts", "reach", "partpacking", "sequence", "paths", "pathsums",
           "nonsequential", "tracer", "probes",
           "precision")  # fmt: skip
IMAGING = ("images", "patterns", "detector")
MEASURING = ("lightcurves", "centroids", "profiles", "phase", "slopes", "reconstruction", "refinement", "measures",
             "prediction")  # fmt: skip
ASSEMBLY = ("comparison", "straylight", "errorparts", "files", "report", "plots", "studies", "pipeline", "targets",
            "stability", "bench", "cli", "__main__")  # fmt: skip
ORDER = MATHEMATICS + DESCRIPTION + DEVICE + TRACING + IMAGING + MEASURING + ASSEMBLY

MAY_IMPORT_PYOPENCL = {"device", "program", "selftest", "execution"}
WITHOUT_NUMPY = {"__init__", "checked", "element", "scene", "presets", "cli", "__main__"}  # so that they start fast
ONLY_FROM = {
    "surface": {"geometry", "zernikes"},
    "calibration": {"scene", "surface", "geometry", "memory"},
    "presets": {"checked", "scene"},
    "scene": {"checked", "element", "scatter"},
    "element": {"checked"},
}
# What knows the true surface. The measuring half gets images and the nominal scene.
KNOWS_TRUTH = {"tracer", "transport", "windows", "packing", "samplers", "device", "program", "selftest", "execution"}

MAX_FILE_LINES = 400
MAX_FUNCTION_LINES = 60
MAX_KERNEL_LINES = 250

# A package such as studies/ counts as one module.
SOURCES = sorted(PACKAGE.rglob("*.py"))


def module_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def imported(path: Path, node: ast.AST) -> list[str]:
    """Dotted absolute names that an import statement may bind or load; [] for any other node."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    base = node.module or ""
    if node.level:
        folder = path.parent.relative_to(ROOT).parts
        base = ".".join([*folder[: len(folder) - node.level + 1], *filter(None, [node.module])])
    # `from irtscots_cl import zonal` loads the module irtscots_cl.zonal
    return [f"{base}.{alias.name}" for alias in node.names] if base == "irtscots_cl" else [base]


def imports(path: Path) -> set[str]:
    """All that a file imports, at its top or inside functions."""
    return {name for node in ast.walk(tree_of(path)) for name in imported(path, node)}


def imports_at_start(path: Path) -> set[str]:
    """What importing the file imports at once: not what its functions import."""

    def outside_functions(node: ast.AST):
        yield node
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
                yield from outside_functions(child)

    return {name for node in outside_functions(tree_of(path)) for name in imported(path, node)}


def own(names: set[str]) -> set[str]:
    """Those of the names that are modules of the package, without its name."""
    return {name.split(".")[1] for name in names if name.startswith("irtscots_cl.")}


def third_party(names: set[str]) -> set[str]:
    return {name.split(".")[0] for name in names} - {"irtscots_cl"}


def test_modules_are_found_and_have_a_place():
    modules = {module_of(path) for path in SOURCES}
    assert {"geometry", "scene", "device", "tracer"} <= modules  # or the tests below look at nothing
    assert modules - {"__init__"} <= set(ORDER), "give a new module its place in ORDER"


def test_imports_are_read():
    source = "from .scene import A\nfrom irtscots_cl import zonal\ndef f():\n    import pyopencl.array\n"
    path = PACKAGE / "sample.py"
    tree = ast.parse(source)
    names = {name for node in ast.walk(tree) for name in imported(path, node)}
    assert own(names) == {"scene", "zonal"}
    assert third_party(names) == {"pyopencl"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_one_way(path):
    module = module_of(path)
    if module == "__init__":
        assert own(imports(path)) == set()  # its names are resolved lazily
        return
    before = set(ORDER[: ORDER.index(module)])
    wrong = own(imports(path)) - before - {module}
    assert not wrong, f"{module} imports {sorted(wrong)}, which do not come before it"


@pytest.mark.parametrize("module", ONLY_FROM)
def test_description_knows_only_what_it_needs(module):
    assert own(imports(PACKAGE / f"{module}.py")) <= ONLY_FROM[module]


def test_only_the_device_layer_imports_pyopencl():
    found = {module_of(path) for path in SOURCES if "pyopencl" in third_party(imports(path))}
    assert found == MAY_IMPORT_PYOPENCL


def test_modules_that_start_fast_do_not_import_numpy():
    for path in SOURCES:
        module = module_of(path)
        if module not in WITHOUT_NUMPY:
            continue
        loaded = closure(module)
        heavy = {"numpy", "scipy", "skimage", "h5py", "matplotlib", "pyopencl"}
        names = third_party(imports_at_start(path)).union(*(third_party(imports_at_start(p)) for p in files_of(loaded)))
        assert not names & heavy, f"{module} loads {sorted(names & heavy)} at import"


def files_of(modules: set[str]) -> list[Path]:
    return [path for path in SOURCES if module_of(path) in modules]


def closure(module: str) -> set[str]:
    """Modules of the package that importing `module` loads, through others too."""
    seen, todo = set(), [module]
    while todo:
        for path in files_of({todo.pop()}):
            new = own(imports_at_start(path)) - seen
            seen |= new
            todo += new
    return seen


def test_measuring_half_never_sees_the_true_surface():
    measuring = [path for path in SOURCES if module_of(path) in MEASURING]
    assert measuring
    for path in measuring:
        wrong = own(imports(path)) & KNOWS_TRUTH
        assert not wrong, f"{path.name} imports {sorted(wrong)}"


def test_measuring_half_needs_no_device():
    """A lab's images are measured without OpenCL: not even through other modules is it imported."""
    for module in {module_of(path) for path in SOURCES} & set(MEASURING):
        assert not closure(module) & (KNOWS_TRUTH - {"transport"}), module


def test_package_imports_no_tests_and_reads_nothing_outside():
    outside = re.compile(r"\btests\b|\.\./|\bshared/")
    for path in SOURCES:
        assert not third_party(imports(path)) & {"tests", "oracle", "conftest", "pytest", "hypothesis"}, path.name
        strings = (n.value for n in ast.walk(tree_of(path)) if isinstance(n, ast.Constant) and isinstance(n.value, str))
        assert not [text for text in strings if outside.search(text)], path.name


RUNS_CODE = {"eval", "exec", "compile", "__import__"}
LOADS_CODE = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "yaml", "ctypes"}
IMPORTS_BY_NAME = {"__init__", "studies"}  # from tables of their own
STARTS_PROGRAMS = {"bench"}  # git, to name the version that was measured


def code_runners(tree: ast.AST) -> set[str]:
    """What in a file could run what a file holds."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            found |= {name} & (RUNS_CODE | {"os.system", "os.popen", "np.load", "numpy.load", "np.fromfile"})
            found |= {f"{k.arg}=" for k in node.keywords if k.arg in ("allow_pickle", "shell")}
    return found


def test_what_could_run_code_is_found():
    source = "eval(x)\nnp.load(f, allow_pickle=True)\nos.system(c)\nre.compile(p)\n"
    assert code_runners(ast.parse(source)) == {"eval", "np.load", "allow_pickle=", "os.system"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_nothing_that_is_read_is_run(path):
    assert code_runners(tree_of(path)) == set()
    names = third_party(imports(path))
    assert not names & LOADS_CODE
    assert "subprocess" not in names or module_of(path) in STARTS_PROGRAMS
    by_name = {name for name in imports(path) if name == "importlib"} and "import_module" in path.read_text("utf-8")
    assert not by_name or module_of(path) in IMPORTS_BY_NAME


def test_oracle_does_not_import_the_package():
    for path in (ROOT / "tests" / "oracle").rglob("*.py"):
        assert not any(name.split(".")[0] == "irtscots_cl" for name in imports(path)), path.name


def test_sizes():
    too_long = []
    for path in SOURCES:
        lines = len(path.read_text(encoding="utf-8").splitlines())
        if lines > MAX_FILE_LINES:
            too_long.append(f"{path.name}: {lines} lines")
        for node in ast.walk(tree_of(path)):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                length = node.end_lineno - node.lineno + 1
                if length > MAX_FUNCTION_LINES:
                    too_long.append(f"{path.name}: {node.name} has {length} lines")
    for path in sorted((ROOT / "kernels").glob("*.cl")):
        lines = len(path.read_text(encoding="ascii").splitlines())
        if lines > MAX_KERNEL_LINES:
            too_long.append(f"{path.name}: {lines} lines")
    assert not too_long, "\n".join(too_long)
