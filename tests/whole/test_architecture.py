"""The package's structure, read from its source: one-way imports, what each layer may know, sizes."""

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "irtscots_cl"

TABLE = re.compile(r"^    (\w+) {2,}(.+)$", re.MULTILINE)  # of the folders, in the package's docstring
FOLDERS = dict(TABLE.findall(ast.get_docstring(ast.parse((PACKAGE / "__init__.py").read_text("utf-8")), clean=False)))
ORDER = tuple(FOLDERS)

# What a folder may import of those above it, where that is not all.
ONLY_FROM = {
    "system": set(),
    "maths": {"system"},
    "formats": {"system", "maths"},
    "opencl": set(),
    "scene": {"system", "maths", "formats"},
    "execution": {"system", "opencl"},
    "optics": {"system", "maths", "scene"},
    "imaging": {"system", "maths", "formats", "scene", "optics"},
    "measurement": {"system", "maths", "scene", "optics", "imaging"},
    "calibration": {"system", "maths", "formats", "scene", "optics", "imaging", "measurement"},
    "budget": {"system", "maths", "scene", "optics", "imaging", "measurement", "calibration"},
}
WITHOUT_NUMPY = {"irtscots_cl", "irtscots_cl.cli", "irtscots_cl.__main__", "irtscots_cl.scene.model",
                 "irtscots_cl.scene.presets", "irtscots_cl.scene.element", "irtscots_cl.scene.validation"}  # fmt: skip

MAX_FILE_LINES = 400
MAX_FUNCTION_LINES = 60
MAX_KERNEL_LINES = 250

# A package such as studies/ counts as one module.
SOURCES = sorted(PACKAGE.rglob("*.py"))


def module_of(path: Path) -> str:
    """Dotted name of a module; of a folder's __init__ that of the folder."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def folder_of(path: Path) -> str:
    """The folder at the top of the package that a file is in; "" for files of the package itself."""
    parts = path.relative_to(PACKAGE).parts
    return parts[0] if len(parts) > 1 else ""


MODULES = {module_of(path): path for path in SOURCES}


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
    # `from irtscots_cl.maths import frame` loads the module irtscots_cl.maths.frame
    return [f"{base}.{a.name}" if f"{base}.{a.name}" in MODULES else base for a in node.names]


@cache
def imports(path: Path) -> set[str]:
    """All that a file imports, at its top or inside functions."""
    return {name for node in ast.walk(tree_of(path)) for name in imported(path, node)}


def imports_at_start(path: Path) -> set[str]:
    """What importing the file imports at once: not what its functions import."""

    def outside_functions(node: ast.AST):
        yield node
        for child in ast.iter_child_nodes(node):
            later = isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)) or for_type_checkers(child)
            if not later:
                yield from outside_functions(child)

    return {name for node in outside_functions(tree_of(path)) for name in imported(path, node)}


def for_type_checkers(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def own(names: set[str]) -> set[str]:
    """Those of the names that are modules of the package."""
    return {name for name in names if name in MODULES}


def folders(names: set[str]) -> set[str]:
    """The folders that modules of the package are in."""
    return {folder_of(MODULES[name]) for name in own(names)} - {""}


def third_party(names: set[str]) -> set[str]:
    return {name.split(".")[0] for name in names} - {"irtscots_cl"}


def test_the_table_of_folders_is_the_tree():
    there = {folder_of(path) for path in SOURCES} - {""}
    assert set(ORDER) == there
    for folder, text in FOLDERS.items():
        said = ast.get_docstring(tree_of(PACKAGE / folder / "__init__.py"))
        assert said.splitlines()[0] == text


def test_imports_are_read():
    source = "from .model import A\nfrom irtscots_cl.maths import frame\ndef f():\n    import pyopencl.array\n"
    path = PACKAGE / "scene" / "sample.py"
    names = {name for node in ast.walk(ast.parse(source)) for name in imported(path, node)}
    assert own(names) == {"irtscots_cl.scene.model", "irtscots_cl.maths.frame"}
    assert third_party(names) == {"pyopencl"}


def wrong_folders(path: Path) -> set[str]:
    """What a file imports from and may not."""
    folder, found = folder_of(path), folders(imports(path))
    if not folder:  # the package itself, whose names are resolved lazily, and __main__
        return found - {"system", "cli"} if path.stem == "__main__" else folders(imports_at_start(path))
    above = set(ORDER[: ORDER.index(folder)])
    return found - {folder} - (above & ONLY_FROM.get(folder, above))


def test_folders_import_one_way():
    assert {module_of(path): wrong for path in SOURCES if (wrong := wrong_folders(path))} == {}


def test_modules_import_one_way():
    """No circle among the modules, also not within a folder."""
    graph = {name: own(imports_at_start(path)) - {name} for name, path in MODULES.items()}
    while leaves := {name for name, needs in graph.items() if not needs & graph.keys()}:
        graph = {name: needs for name, needs in graph.items() if name not in leaves}
    assert not graph, f"in a circle, or importing one: {sorted(graph)}"


def test_private_names_stay_in_their_module():
    for path in SOURCES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("irtscots_cl"):
                private = [alias.name for alias in node.names if re.match(r"_[^_]", alias.name)]
                assert not private, f"{module_of(path)} imports {private}"


def test_only_opencl_imports_pyopencl():
    assert {folder_of(path) for path in SOURCES if "pyopencl" in third_party(imports(path))} == {"opencl"}


def test_modules_that_start_fast_do_not_import_numpy():
    heavy = {"numpy", "scipy", "skimage", "h5py", "matplotlib", "pyopencl"}
    for module in WITHOUT_NUMPY:
        names = set().union(*(third_party(imports_at_start(MODULES[name])) for name in closure(module)))
        assert not names & heavy, f"{module} loads {sorted(names & heavy)} at import"


def closure(module: str) -> set[str]:
    """Modules of the package that importing `module` loads, itself, folders and others' imports included."""
    seen, todo = set(), [module]
    while todo:
        name = todo.pop()
        parents = {name.rsplit(".", k)[0] for k in range(name.count(".") + 1)}
        new = ({name} | parents | own(imports_at_start(MODULES[name]))) - seen
        seen |= new
        todo += new - {name}
    return seen


def test_measurement_needs_no_device():
    """A lab's images are measured without OpenCL: not even through other modules is it imported."""
    measuring = [name for name in MODULES if name.startswith("irtscots_cl.measurement.")]
    assert measuring
    for module in measuring:
        loaded = {folder_of(MODULES[name]) for name in closure(module)}
        assert not loaded & {"tracing", "opencl", "execution"}, module


def test_package_imports_no_tests_and_reads_nothing_outside():
    outside = re.compile(r"\btests/|\.\./|\bshared/")
    for path in SOURCES:
        assert not third_party(imports(path)) & {"tests", "oracle", "conftest", "pytest", "hypothesis"}, path.name
        strings = (n.value for n in ast.walk(tree_of(path)) if isinstance(n, ast.Constant) and isinstance(n.value, str))
        assert not [text for text in strings if outside.search(text)], path.name


RUNS_CODE = {"eval", "exec", "compile", "__import__"}
LOADS_CODE = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "ctypes"}
YAML_NAMES = {"yaml.load", "yaml.BaseLoader", "yaml.YAMLError"}  # this loader makes text, lists and tables only
IMPORTS_BY_NAME = {"", "scene", "studies"}  # from tables of their own
STARTS_PROGRAMS = {"bench"}  # git, to name the version that was measured


def code_runners(tree: ast.AST) -> set[str]:
    """What in a file could run what a file holds."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            found |= {name} & (RUNS_CODE | {"os.system", "os.popen", "np.load", "numpy.load", "np.fromfile"})
            found |= {f"{k.arg}=" for k in node.keywords if k.arg in ("allow_pickle", "shell")}
            found |= {f"{name} with {ast.unparse(k)}" for k in node.args[1:] if name == "yaml.load"} - {
                "yaml.load with yaml.BaseLoader",
                "yaml.load with getattr(yaml, 'CBaseLoader', yaml.BaseLoader)",  # the same in C
            }
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "yaml":
            found |= {ast.unparse(node)} - YAML_NAMES
    return found


def test_what_could_run_code_is_found():
    source = "eval(x)\nnp.load(f, allow_pickle=True)\nos.system(c)\nre.compile(p)\nyaml.load(f, yaml.Loader)\n"
    found = {"eval", "np.load", "allow_pickle=", "os.system", "yaml.Loader", "yaml.load with yaml.Loader"}
    assert code_runners(ast.parse(source)) == found
    assert code_runners(ast.parse("yaml.load(f, yaml.BaseLoader)\nyaml.unsafe_load(f)")) == {"yaml.unsafe_load"}


def ways_to_run_data(path: Path) -> set[str]:
    """Names by which a file could run what it reads, and may not."""
    names = third_party(imports(path))
    found = code_runners(tree_of(path)) | (names & LOADS_CODE)
    if "subprocess" in names and folder_of(path) not in STARTS_PROGRAMS:
        found |= {"subprocess"}
    if "importlib" in imports(path) and "import_module" in path.read_text("utf-8"):
        found |= {"import_module"} if folder_of(path) not in IMPORTS_BY_NAME else set()
    return found


def test_nothing_that_is_read_is_run():
    assert {module_of(path): found for path in SOURCES if (found := ways_to_run_data(path))} == {}


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
    for path in sorted((ROOT / "kernels").rglob("*.cl")):
        lines = len(path.read_text(encoding="ascii").splitlines())
        if lines > MAX_KERNEL_LINES:
            too_long.append(f"{path.name}: {lines} lines")
    assert not too_long, "\n".join(too_long)
