"""The package's public names: complete, lazy, and functions where a module has the same name."""

import ast
from pathlib import Path

import pytest
from loaded_modules import loaded_modules
from synthetic import small_scene

import irtscots_cl as irt


@pytest.mark.parametrize("name", sorted(irt.__all__))
def test_every_public_name_resolves(name):
    assert name in dir(irt)
    assert getattr(irt, name) is getattr(irt, name)


def test_type_checkers_see_the_public_names():
    """Each from the module that __getattr__ takes it from, and no other."""
    tree = ast.parse(Path(irt.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    imported, aliases, declared = {}, {}, set()
    for node in block.body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                assert alias.asname == alias.name, "a name that is not repeated is not exported"
                imported[alias.name] = node.module.removeprefix("irtscots_cl.")
        elif isinstance(node, ast.Assign):
            aliases[node.targets[0].id] = node.value.id
        else:
            declared.add(node.target.id)
    assert (imported, aliases, declared) == (irt._PUBLIC, irt._ALIASES, {"__version__"})
    assert (Path(irt.__file__).parent / "py.typed").exists()


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'irtscots_cl' has no attribute 'sphere'"):
        irt.sphere  # noqa: B018


def test_version_is_a_version():
    assert irt.__version__[0].isdigit()


@pytest.mark.parametrize(
    "code",
    [
        "import irtscots_cl",
        "import irtscots_cl; dir(irtscots_cl); irtscots_cl.__version__",
    ],
)
def test_import_loads_nothing_heavy(code):
    loaded = loaded_modules(code)
    assert "irtscots_cl" in loaded
    heavy = {"numpy", "scipy", "skimage", "pyopencl", "matplotlib", "h5py", "pydantic", "rich", "jinja2"}
    assert not heavy & loaded


def test_listing_the_scenes_needs_no_numpy():
    loaded = loaded_modules("from irtscots_cl.cli import main; assert main(['scenes']) == 0")
    assert "irtscots_cl.cli" in loaded
    assert not {"numpy", "scipy", "pyopencl", "matplotlib", "h5py", "rich"} & loaded


def test_loading_a_scene_needs_no_numpy():
    loaded = loaded_modules("import irtscots_cl as irt; irt.load_scene('sphere')")
    assert "pydantic" in loaded
    assert not {"numpy", "scipy", "pyopencl", "matplotlib", "h5py"} & loaded


def test_help_needs_no_numpy():
    ending = "\ntry: main(['run', '--help'])\nexcept SystemExit: pass\nimport irtscots_cl"
    loaded = loaded_modules(f"from irtscots_cl.cli import main{ending}")
    assert "irtscots_cl.cli" in loaded
    assert not {"numpy", "scipy", "pyopencl", "matplotlib", "h5py", "rich"} & loaded


@pytest.mark.parametrize("drawn", [False, True])
def test_a_run_loads_no_slow_package_that_it_does_not_use(tmp_path, drawn):
    (tmp_path / "small.toml").write_text(small_scene("sphere-deviated", 17).to_toml())
    more = ["run", str(tmp_path / "small.toml"), "--estimator", "analytic", "--out", str(tmp_path / "out")]
    more += [] if drawn else ["--no-figures"]
    loaded = loaded_modules(f"from irtscots_cl.cli import main; assert main({more}) == 0")
    assert {"numpy", "scipy.sparse.linalg", "h5py"} <= loaded
    assert ("matplotlib" in loaded, "PIL" in loaded) == (drawn, drawn)
    slow = {
        "scipy.stats",
        "scipy.interpolate",
        "scipy.optimize",
        "scipy.spatial",
        "scipy.fft",
        "skimage",
        "distributed",
    }
    slow |= {"dask", "pandas", "astropy", "tifffile", "yaml", "mpmath"}
    assert not slow & loaded
