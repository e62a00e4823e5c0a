"""The house: imports only go up the shelves (DESIGN.md 2), and the lower ones know neither dolfinx nor MPI."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "fenics_forming"
SHELVES = ["errors", "units", "laws", "scene", "physics", "process", "results", "simulation", "cli"]
LEVEL = {"errors": 0, "units": 0, "laws": 1, "scene": 2, "physics": 3, "process": 4, "results": 5, "simulation": 6,
         "cli": 7, "__init__": 8, "__main__": 8}
LEVEL_OF_ROOT = {"__version__": 0}     # a constant of fenics_forming/__init__.py, which imports nothing by itself

# file → what it may import from a higher shelf, and why
EXCEPTIONS: dict[str, set[str]] = {}

FILES = sorted(PACKAGE.rglob("*.py"))


def shelf(path):
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imports(path):
    """(shelf, whole module, lazily) of everything that a file imports from the package; lazily: in a function."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {id(n) for f in ast.walk(tree) if isinstance(f, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
              for n in ast.walk(f)}
    package = path.relative_to(PACKAGE.parent).parts[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            name = ".".join([*base, *([node.module] if node.module else [])])
            modules = [f"{name}.{alias.name}" for alias in node.names]
        else:
            continue
        yield from ((module, id(node) in inside) for module in modules)


def within(path):
    """Imports of a file from the package itself: (first word below fenics_forming, whole name, lazily)."""
    for module, lazily in imports(path):
        words = module.split(".")
        if words[0] == "fenics_forming":
            yield words[1], module, lazily


def test_every_module_stands_on_a_shelf():
    assert {shelf(path) for path in FILES} == set(LEVEL)
    assert len(FILES) > 40, "the walk found the package"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_only_go_up_the_shelves(path):
    level, allowed = LEVEL[shelf(path)], EXCEPTIONS.get(str(path.relative_to(PACKAGE)), set())
    for word, module, _ in within(path):
        above = LEVEL_OF_ROOT.get(word, LEVEL.get(word, 99))
        assert above <= level or word in allowed, f"{path.relative_to(PACKAGE)} imports {module}"


def test_exceptions_are_still_needed():
    for name, words in EXCEPTIONS.items():
        path = PACKAGE / name
        assert words <= {word for word, _, _ in within(path) if LEVEL[word] > LEVEL[shelf(path)]}, name


def test_no_two_modules_import_one_another():
    """Not in a function either, and not over third ones: what stands above may use what is below, never the other way."""
    names = {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
             for path in FILES}
    needs = {}
    for name, path in names.items():
        found = [module for _, module, _ in within(path)]
        needs[name] = {module if module in names else module.rpartition(".")[0] for module in found} & set(names) - {name}
    while free := [name for name, below in needs.items() if not below]:
        for name in free:
            del needs[name]
        for below in needs.values():
            below.difference_update(free)
    assert not needs, f"these wait for one another: {sorted(needs)}"


HEAVY = {"dolfinx", "ufl", "basix", "petsc4py", "mpi4py", "gmsh", "numba", "pyvista", "matplotlib", "meshio", "rich",
         "scipy"}


@pytest.mark.parametrize("path", [p for p in FILES if LEVEL[shelf(p)] <= 2 or shelf(p) in ("cli", "__init__")],
                         ids=lambda p: str(p.relative_to(PACKAGE)))
def test_laws_scene_and_command_line_load_no_heavy_library(path):
    """They may use one lazily (laws answer to UFL expressions), never when they are imported."""
    loaded = {module.split(".")[0] for module, lazily in imports(path) if not lazily}
    assert not loaded & HEAVY


@pytest.mark.parametrize("path", [p for p in FILES if shelf(p) == "scene"], ids=lambda p: p.name)
def test_scene_never_imports_dolfinx(path):
    assert not {module.split(".")[0] for module, _ in imports(path)} & {"dolfinx", "ufl", "basix", "petsc4py", "mpi4py"}


@pytest.mark.parametrize("path", [p for p in FILES if shelf(p) == "results"], ids=lambda p: p.name)
def test_results_load_drawing_libraries_lazily_and_never_solve(path):
    loaded = {module.split(".")[0] for module, lazily in imports(path) if not lazily}
    assert not loaded & {"pyvista", "matplotlib", "meshio", "gmsh", "rich", "numba"}
    assert not {module for _, module, _ in within(path) if ".newton" in module or ".linear" in module}


def test_only_the_physics_and_simulation_name_petsc():
    """One place for solvers: process, results and the scene work on arrays."""
    named = {shelf(p) for p in FILES if any(module.startswith("petsc4py") for module, _ in imports(p))}
    assert named == {"physics"}
