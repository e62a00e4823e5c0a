"""A scene as TOML text: a table for what has a name, one line for what describes it."""

import re

_HEADER = "# numbers are in mm, s, t, N, MPa, mJ, degC, rad\n"
_IN_ONE_LINE = ("shape", "drive", "friction", "flow_stress", "remesh", "adaptive", "damage", "shifting",
                "mesh_size", "held", "loads", "springs", "initial_velocity")


def toml_text(table):
    """The nested tables of a scene as TOML text."""
    import tomlkit

    document = tomlkit.document()
    for line in _HEADER.strip().splitlines():
        document.add(tomlkit.comment(line.lstrip("# ")))
    _fill(document, table)
    text = tomlkit.dumps(document)
    return re.sub(r"\n{3,}", "\n\n", text)


def _fill(container, table):
    import tomlkit

    for key, value in sorted(table.items(), key=lambda item: _is_branch(*item)):
        if _is_branch(key, value):
            branch = tomlkit.table(is_super_table=all(_is_branch(*item) for item in value.items()))
            _fill(branch, value)
            container[key] = branch
        elif isinstance(value, dict):
            container[key] = _inline(value)
        else:
            container[key] = _one_a_line(value) if _holds_tables(value) else value


def _is_branch(key, value):
    return isinstance(value, dict) and key not in _IN_ONE_LINE


def _holds_tables(value):
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _one_a_line(tables):
    import tomlkit

    array = tomlkit.array().multiline(True)
    array.extend(_inline(table) for table in tables)
    return array


def _inline(table):
    import tomlkit

    inline = tomlkit.inline_table()
    for key, value in table.items():
        inline[key] = _inline(value) if isinstance(value, dict) else value
    return inline
